"""How many samples a picture is of, told by its edges."""

from pathlib import Path

import numpy as np
import pytest

from jflnr import exr
from jflnr.frame import read_frame
from jflnr.layouts.samples import count_samples, shares_of


def sampled(samples: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normals, albedo and coverage of 24 flat triangles, each pixel a mean of so many points."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-20, 140, (24, 3, 2))
    values = np.concatenate([rng.normal(size=(25, 3)), rng.random((25, 3))], axis=1)
    values[:, :3] /= np.linalg.norm(values[:, :3], axis=1, keepdims=True)
    points = rng.random((samples, 96, 120, 2)) + np.mgrid[:96, :120].transpose(1, 2, 0)
    seen = np.zeros(points.shape[:3], int)
    for k, triangle in enumerate(corners, 1):
        sides = zip(triangle, np.roll(triangle, 1, axis=0), strict=True)
        turns = [
            (b - a)[0] * (points - a)[..., 1] - (b - a)[1] * (points - a)[..., 0] for a, b in sides
        ]
        seen[np.all(np.greater(turns, 0), axis=0) | np.all(np.less(turns, 0), axis=0)] = k
    means = values[seen].mean(axis=0).astype(np.float16).astype(np.float32)
    return means[..., :3], means[..., 3:], (seen > 0).mean(axis=0)[..., None]


@pytest.mark.parametrize("samples", [2, 3, 4, 8, 10, 16, 32])
@pytest.mark.parametrize("seed", [0, 1])
def test_edges_tell_the_samples(samples: int, seed: int) -> None:
    assert count_samples(*shares_of(*sampled(samples, seed))) == samples


def test_many_samples_are_told_from_none() -> None:
    normal, albedo, _ = sampled(200, 0)
    assert count_samples(*shares_of(normal, albedo, None)) == 64
    alone = sampled(1, 0)
    assert count_samples(*shares_of(*alone)) == 0
    texture = np.cumsum(np.random.default_rng(1).random(albedo.shape), axis=1) % 1
    assert count_samples(*shares_of(alone[0], texture, None)) == 0


def test_what_is_not_finite_does_not_count() -> None:
    normal, albedo, alpha = sampled(4, 0)
    normal[::2], albedo[5:9] = np.nan, np.inf
    assert count_samples(*shares_of(normal, albedo, alpha)) == 4


def test_parts_of_a_file_tell_what_all_of_it_does(tmp_path: Path) -> None:
    pytest.importorskip("OpenImageIO")
    from jflnr.large.scanlines import Scanlines

    normal, albedo, alpha = sampled(5, 3)
    passes = {
        "Combined": ("RGBA", np.concatenate([albedo, alpha], axis=-1)),
        "DiffCol": ("RGB", albedo),
        "Denoising Albedo": ("RGB", albedo),
        "Normal": ("XYZ", normal),
        "Depth": ("Z", 1 + alpha),
    }
    channels = {
        f"ViewLayer.{name}.{c}": layer[..., k].astype(np.float32)
        for name, (components, layer) in passes.items()
        for k, c in enumerate(components)
    }
    path = tmp_path / "picture.exr"
    exr.write_channels(path, channels)
    frame, parts = read_frame(path), Scanlines(path, None, {})
    assert np.all(frame.samples == 5)
    assert np.all(parts.rows(("samples",)).read(40, 70).samples == 5)
    whole = shares_of(frame.normal, frame.seen_albedo, frame.alpha)
    for ours, theirs in zip(parts.shares, whole, strict=True):
        np.testing.assert_array_equal(np.sort(ours), np.sort(theirs))
