"""The noise-free layers, the camera, and a frame of `shared/data` rendered again."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from experiments.rendering.source import load, shared_frames, shared_scenes
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera
from jflnr.exr import read_attributes, read_channels


def test_normals_are_unit_and_face_the_camera(tracer: Tracer, room: Any) -> None:
    hit = tracer.guides["depth"][..., 0] > 0
    normal = tracer.guides["normal"]
    np.testing.assert_allclose(np.linalg.norm(normal[hit], axis=-1), 1, atol=1e-5)
    towards = room.own[0].to_world[:3, 3] - tracer.guides["position"]
    assert ((normal * towards).sum(-1)[hit] > -1e-4).all()


def test_ranges(tracer: Tracer) -> None:
    occlusion = tracer.occlusion(64, 1.0, 3)
    assert occlusion.min() >= 0 and occlusion.max() <= 1 and 0.2 < occlusion.mean() < 1
    np.testing.assert_array_equal(occlusion * 64, np.round(occlusion * 64))
    assert 0 <= tracer.guides["albedo"].min() and tracer.guides["albedo"].max() <= 1
    assert set(np.unique(tracer.guides["mask"])) <= {0, 1}
    assert (tracer.guides["emission"] * tracer.guides["mask"] == 0).all()


def test_position_is_what_depth_and_camera_say(tracer: Tracer, room: Any) -> None:
    camera = room.own[0]
    y, x = np.mgrid[:36, :64] + 0.5
    pixels = np.stack([x, y], -1)
    points = camera.points(pixels, tracer.guides["depth"][..., 0], 64, 36)
    np.testing.assert_allclose(points, tracer.guides["position"], atol=2e-5)
    np.testing.assert_allclose(camera.project(points, 64, 36), pixels, atol=1e-6)


def _layer(channels: dict[str, Any], name: str, axes: str) -> np.ndarray:
    """Every fifth pixel: those whose centres a picture of a fifth of the size has."""
    return np.stack([channels[f"{name}.{a}"].astype(float)[2::5, 2::5] for a in axes], -1)


def test_a_stored_frame_rendered_again() -> None:
    path = shared_frames() / "train" / "bathroom_0.exr"
    if not path.exists() or not (shared_scenes() / "bathroom").exists():
        pytest.skip("needs shared/data and shared/scenes (or JFLNR_DATA and JFLNR_SCENES)")
    facts, channels = json.loads(read_attributes(path).comments), read_channels(path)
    camera = Camera(np.array(facts["camera_to_world"]), facts["fov_x_degrees"])
    tracer = Tracer.of(load("bathroom").scene, camera, 128, 72)
    for name, axes, close in (
        ("albedo", "RGB", 1e-3),
        ("normal", "XYZ", 1e-3),
        ("position", "XYZ", 2e-3),
        ("depth", "Z", 1e-4),
        ("emission", "RGB", 1e-6),
    ):
        off = np.abs(tracer.guides[name] - _layer(channels, name, axes)).max(-1)
        assert np.mean(off > close) < 1e-3, name
    occlusion = tracer.occlusion(64, facts["ao_distance"], 1)[..., 0]
    stored = _layer(channels, "ao", "Y")[..., 0]
    assert abs((occlusion - stored).mean()) < 5 * 0.5 / np.sqrt(64 * stored.size)
    mask = _layer(channels, "mask", "Y")[..., 0] > 0
    direct = (tracer.direct(64, 2) / 64)[mask].mean()
    assert direct == pytest.approx(_layer(channels, "direct", "RGB")[mask].mean(), rel=0.02)
    _compare_indirect(tracer, channels, mask, facts["reference_median_relative_standard_error"])


def _compare_indirect(
    tracer: Tracer, channels: dict[str, Any], mask: np.ndarray, relative: float
) -> None:
    """Means over the picture and over blocks of 64 pixels, within both sides' standard errors.

    Theirs is the relative one of the header, doubled: that is its median, and its tail is long.
    """
    stored = _blocks(_layer(channels, "reference", "RGB").mean(-1) * mask)
    ours = [_blocks(tracer.indirect(64, seed, 0).mean(-1) * mask / 64) for seed in (11, 12, 13, 14)]
    mean, spread = np.mean(ours, 0), np.std(ours, 0, ddof=1) / 2
    error = np.hypot(spread, 2 * relative * stored / 8) + 1e-9
    assert np.mean(np.abs(mean - stored) < 3 * error) > 0.97
    total = np.hypot(np.std([b.sum() for b in ours], ddof=1) / 2, 0.005 * stored.sum())
    assert abs(mean.sum() - stored.sum()) < 4 * total


def _blocks(picture: np.ndarray) -> np.ndarray:
    h, w = picture.shape
    return picture.reshape(h // 8, 8, w // 8, 8).mean((1, 3))
