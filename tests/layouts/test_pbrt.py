"""pbrt-v4's gbuffer film, by the channel names in its source (src/pbrt/film.cpp)."""

from pathlib import Path

import numpy as np
import pytest

from jflnr import exr, layouts
from jflnr.frame import Frame, composite, read_frame

OLD = {"P.": "P", "N.": "N", "Ns.": "Ns"}


def gbuffer(frame: Frame, old: bool = False, world: bool = False) -> dict[str, np.ndarray]:
    """What the film would write of `frame`, seen from (1, 2, 10) along -z in the world."""
    light = frame.indirect + frame.direct
    depth = frame.depth.copy()
    depth[:2] = 0
    hit = depth > 0
    camera = np.where(hit, np.concatenate([frame.position[..., :2], depth], -1), 0)
    points = np.where(hit, camera * [1, 1, -1] + [1, 2, 0], 0) if world else camera
    layers = {
        "": ("RGB", np.where(hit, frame.albedo * light, 0.75)),
        "Albedo.": ("RGB", np.where(hit, frame.albedo, 0)),
        "P.": ("XYZ", points),
        "N.": ("XYZ", np.where(hit, -frame.normal, 0)),
        "Ns.": ("XYZ", np.where(hit, frame.normal, 0)),
        "Variance.": ("RGB", light),
        "RelativeVariance.": ("RGB", light),
    }
    channels = {name: depth[..., 0] for name in ("dzdx", "dzdy", "u", "v")}
    for stem, (components, image) in layers.items():
        for i, c in enumerate(components):
            name = f"{OLD[stem]}{c.lower()}" if old and stem in OLD else f"{stem}{c}"
            channels[name] = image[..., i]
    return {name: pixels.astype(np.float32) for name, pixels in channels.items()}


@pytest.mark.parametrize("old", [False, True])
def test_layers(tmp_path: Path, frame: Frame, old: bool) -> None:
    channels = gbuffer(frame, old)
    exr.write_channels(tmp_path / "a.exr", channels)
    read = read_frame(tmp_path / "a.exr")
    assert layouts.load(tmp_path / "a.exr").layout.program == "pbrt"
    np.testing.assert_array_equal(read.normal[2:], frame.normal[2:])
    np.testing.assert_allclose(read.depth[2:], frame.depth[2:])
    light = (frame.indirect + frame.direct)[2:]
    np.testing.assert_allclose(read.indirect[2:], light, rtol=1e-5)
    assert (read.mask[:2] == 0).all() and (read.mask[2:] == 1).all()
    picture = np.stack([channels[c] for c in "RGB"], -1)
    np.testing.assert_allclose(composite(read, read.indirect), picture, rtol=1e-5)
    np.testing.assert_array_equal(composite(read, read.indirect + 5)[:2], 0.75)  # the sky


def test_depth_needs_camera_coordinates_or_the_camera(tmp_path: Path, frame: Frame) -> None:
    channels = gbuffer(frame, world=True)
    exr.write_channels(tmp_path / "a.exr", channels)
    np.testing.assert_array_equal(read_frame(tmp_path / "a.exr").depth[2:], 1)
    to_camera = np.diag([1, 1, -1, 1]).astype(np.float32)
    to_camera[:3, 3] = [-1, -2, 0]
    others = {"worldToCamera": to_camera}
    exr.write_channels(tmp_path / "a.exr", channels, others=others)
    np.testing.assert_allclose(read_frame(tmp_path / "a.exr").depth[2:], frame.depth[2:], rtol=1e-5)
