"""Motion of points under a moving camera, against the renderer's projection in float64."""

import numpy as np
import pytest

from experiments.rendering.camera import Camera as Rendered
from jflnr.temporal import Camera, camera_motion

HEIGHT, WIDTH = 9, 14
FROM = Rendered.looking((3, 2, -5), (0, 1, 0), 60)
TO = Rendered.looking((3.3, 2.1, -4.8), (0, 1, 0.2), 50)


def ours(camera: Rendered, moved: float = 0.0) -> Camera:
    matrix = camera.to_world.copy()
    matrix[:3, 3] += moved
    return Camera(matrix.astype(np.float32), camera.fov_x)


@pytest.mark.parametrize("moved", [0.0, 1e3])
def test_as_the_renderer_projects(moved: float) -> None:
    depth = np.random.default_rng(0).uniform(2, 9, (HEIGHT, WIDTH, 1)).astype(np.float32)
    depth[0] = 0
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    here = np.stack([x, y], -1)
    far = np.where(depth > 0, depth, 1e6)[..., 0]
    points = TO.points(here, far, WIDTH, HEIGHT)
    wanted = FROM.project(points, WIDTH, HEIGHT) - here
    motion = camera_motion(depth, ours(TO, moved), ours(FROM, moved))
    assert np.abs(wanted).max() > 1
    np.testing.assert_allclose(motion, wanted, atol=1e-3 if moved else 1e-4)


def test_what_was_behind_the_camera_is_unknown() -> None:
    behind = np.eye(4)
    behind[2, 3] = 5
    depth = np.full((HEIGHT, WIDTH, 1), 2, np.float32)
    depth[:, 7:] = 9
    motion = camera_motion(depth, Camera(np.eye(4), 60), Camera(behind, 60))
    np.testing.assert_array_equal(np.isnan(motion), np.broadcast_to(depth == 2, motion.shape))


def test_cameras_of_headers() -> None:
    assert Camera.of({"scene": "room"}) is None
    camera = Camera.of({"camera_to_world": np.eye(4).tolist(), "fov_x_degrees": 60})
    assert camera is not None and camera.fov_x == 60
    for wrong in ({"fov_x_degrees": 0}, {"camera_to_world": [1, 2]}, {"fov_x_degrees": "wide"}):
        header = {"camera_to_world": np.eye(4).tolist(), "fov_x_degrees": 60} | wrong
        with pytest.raises(ValueError, match="4 x 4"):
            Camera.of(header)
