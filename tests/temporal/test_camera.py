"""The pinhole camera and motion of points under it, against matrices of the textbook in float64."""

import numpy as np
import pytest

from experiments.rendering.camera import looking
from jflnr.camera import centres
from jflnr.temporal import Camera, camera_motion

HEIGHT, WIDTH = 9, 14
FROM = looking((3, 2, -5), (0, 1, 0), 60)
TO = looking((3.3, 2.1, -4.8), (0, 1, 0.2), 50)


def to_pixels(camera: Camera) -> np.ndarray:
    """World to homogeneous pixels and depth: intrinsics times the inverse of the pose, `(4, 4)`."""
    focal = WIDTH / 2 / np.tan(np.radians(camera.fov_x) / 2)
    across, down = [-focal, 0, WIDTH / 2, 0], [0, -focal, HEIGHT / 2, 0]
    return np.array([across, down, [0, 0, 1, 0], [0, 0, 0, 1]]) @ np.linalg.inv(camera.to_world)


def projected(camera: Camera, points: np.ndarray) -> np.ndarray:
    flat = np.concatenate([points, np.ones_like(points[..., :1])], -1) @ to_pixels(camera).T
    return flat[..., :2] / flat[..., 2:3]


def points_of(camera: Camera, depth: np.ndarray) -> np.ndarray:
    here = centres(WIDTH, HEIGHT)
    seen = np.concatenate([here * depth, depth, np.ones_like(depth)], -1)
    return (seen @ np.linalg.inv(to_pixels(camera)).T)[..., :3]


@pytest.fixture
def depth() -> np.ndarray:
    return np.random.default_rng(0).uniform(2, 9, (HEIGHT, WIDTH, 1)).astype(np.float32)


def test_points_and_pixels(depth: np.ndarray) -> None:
    points = TO.points(centres(WIDTH, HEIGHT), depth[..., 0], WIDTH, HEIGHT)
    np.testing.assert_allclose(points, points_of(TO, depth), atol=1e-12)
    found = FROM.project(points, WIDTH, HEIGHT)
    np.testing.assert_allclose(found, projected(FROM, points), atol=1e-10)


def test_left_is_positive_x_and_up_positive_y() -> None:
    camera = looking([0, 0, 0], [0, 0, 5], 90)
    np.testing.assert_allclose(camera.to_world, np.eye(4), atol=1e-12)
    found = camera.project(np.array([[0.5, 0.25, 1], [-0.5, 0, 1]]), 100, 50)
    np.testing.assert_allclose(found, [[25, 12.5], [75, 25]])


@pytest.mark.parametrize("moved", [0.0, 1e3])
def test_motion(depth: np.ndarray, moved: float) -> None:
    depth[0] = 0
    points = points_of(TO, np.where(depth > 0, depth.astype(float), 1e6))
    wanted = projected(FROM, points) - centres(WIDTH, HEIGHT)
    away = np.zeros((4, 4))
    away[:3, 3] = moved
    now, then = (Camera(c.to_world + away, c.fov_x) for c in (TO, FROM))
    motion = camera_motion(depth, now, then)
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
