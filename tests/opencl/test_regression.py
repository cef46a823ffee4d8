"""The four kernels together, against `jflnr.regression.flr.flr` and its twin in plain numpy."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jflnr
from jflnr.images import guides as guide_layers
from jflnr.opencl import Context
from jflnr.opencl.flr import flr
from jflnr.regression.flr import DEFAULT
from jflnr.regression.flr import flr as jax_flr
from tests.opencl import tolerances
from tests.opencl.conftest import PARAMETERS, error, in_float64, scene
from tests.oracle.flr_numpy import flr as numpy_flr


def compare(context: Context, target: np.ndarray, guides: Any, **options: Any) -> float:
    """The error against the regression by plain loops in numpy, which compiles nothing.

    tests/regression compares JAX with the same loops. Pixels that are not finite have weight 0 in
    them, and are left out of the comparison.
    """
    found = flr(target, guides, PARAMETERS, context=context, **options)
    assert found.dtype == np.float32
    options.pop("support", None)
    layers = guides if isinstance(guides, tuple) else (guides,)
    x = np.concatenate([np.float64(layer) for layer in layers], axis=2)
    weight = np.float64(options.pop("weight", np.ones(target.shape[:2])))
    good = np.isfinite(x).all(2) & np.isfinite(target).all(2) & (weight > 0)
    x, y = (np.where(good[..., None], image, 0) for image in (x, np.float64(target)))
    sigma, eps, eps_prime = PARAMETERS.sigma, PARAMETERS.eps, PARAMETERS.eps_prime
    # The window is given in pixels of the output, the loops count in pixels of the target.
    sigma *= target.shape[0] / round(found.shape[0] / 2) / 2 if "guides_map" in options else 1
    right = numpy_flr(y, x, sigma, eps, eps_prime, weight=np.where(good, weight, 0), **options)
    compared = good if found.shape == target.shape else slice(None)
    return error(found[compared], right[compared])


# Channels for each number of guides from 0 on: all of 1 to 9 occur.
CHANNELS = [3, 1, 9, 2, 4, 3, 6, 5, 8, 7, 2, 1, 3]


def test_counts(context: Context) -> None:
    """Every Q and C against one JAX program: a guide or target that is zero changes nothing."""
    target, guides = scene(43, 101, 12, 9)
    program = in_float64(jax_flr, method=PARAMETERS)
    for count, channels in enumerate(CHANNELS):
        found = flr(target[..., :channels], guides[..., :count], PARAMETERS, context=context)
        right = program(target, np.where(np.arange(12) < count, guides, 0))[..., :channels]
        assert error(found, right) < tolerances.WHOLE, (count, channels)


def test_most_guides(context: Context) -> None:
    assert compare(context, *scene(20, 30, 16, 1)) < tolerances.WHOLE


@pytest.mark.parametrize("size", [(1, 1), (1, 19), (7, 7), (8, 16), (300, 5), (41, 303)])
def test_sizes(context: Context, size: tuple[int, int]) -> None:
    assert compare(context, *scene(*size, 5, 3)) < tolerances.WHOLE


@pytest.mark.parametrize("block", [1, 2, 4, 5, 16])
def test_blocks(context: Context, block: int) -> None:
    assert compare(context, *scene(23, 37, 2, 1), block=block) < tolerances.WHOLE


@pytest.mark.parametrize("mask", [False, True])
def test_weights(context: Context, mask: bool) -> None:
    target, guides = scene(60, 71, 5, 3)
    weight = np.random.default_rng(0).uniform(-0.5, 1, (60, 71)).astype(np.float32)
    weight[:24, :40] = 0
    target[30, 31], guides[32, 33, 1] = np.nan, np.inf
    weight = weight > 0 if mask else weight
    assert compare(context, target, guides, weight=weight) < tolerances.WHOLE


def test_rank_deficient_guides(context: Context) -> None:
    target, guides = scene(60, 71, 5, 3)
    guides[..., 1], guides[..., 2], guides[..., 3] = guides[..., 0], 0, 7
    assert compare(context, target, guides) < tolerances.WHOLE


def test_guides_far_from_zero(context: Context) -> None:
    target, guides = scene(60, 71, 5, 3)
    assert compare(context, target, guides * 10 + np.float32(1e4)) < tolerances.WHOLE


@pytest.mark.parametrize("which", ["guides", "target"])
def test_extreme_values(context: Context, which: str) -> None:
    target, guides = scene(60, 71, 5, 3)
    if which == "guides":
        guides[:8, :8, 3], guides[30:, 60, 1] = 1e30, -3e38
    else:
        target[40, 40] = 3e38
    found = flr(target, guides, PARAMETERS, context=context)
    right = np.asarray(jax_flr(target, guides, PARAMETERS))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, right, atol=1e-3 * abs(right).max())


def test_nothing_usable_gives_zero(context: Context) -> None:
    target, guides = scene(20, 30, 5, 3)
    assert not flr(np.full_like(target, np.nan), guides, PARAMETERS, context=context).any()


def test_layers_are_one_image(context: Context) -> None:
    target, guides = scene(60, 71, 5, 3)
    layers = tuple(np.ascontiguousarray(a) for a in np.split(guides, [3, 4], axis=2))
    assert compare(context, target, layers) < tolerances.WHOLE


def test_six_layers_of_mixed_types(context: Context) -> None:
    target, guides = scene(30, 41, 6, 6)
    layers = [guides[..., q : q + 1] for q in range(6)]
    layers[2] = layers[2].astype(np.float16)
    layers[3] = layers[3].astype(np.float64)
    assert compare(context, target, tuple(layers)) < tolerances.WHOLE


@pytest.mark.parametrize("missing", [0, 1])
def test_upsampling(context: Context, missing: int) -> None:
    target, guides = scene(30, 41, 5, 3)
    finer = scene(60 - missing, 82 - missing, 5, 3)[1]
    assert compare(context, target, guides, guides_map=finer, block=4) < tolerances.WHOLE


def test_upsampling_without_guides(context: Context) -> None:
    target, guides = scene(30, 41, 0, 3)
    finer = np.zeros((60, 82, 0), np.float32)
    assert compare(context, target, guides, guides_map=finer, block=4) < tolerances.WHOLE


def test_light_groups_sum_to_the_sum(context: Context) -> None:
    target, guides = scene(60, 71, 2, 9)
    groups = flr(target, guides, PARAMETERS, context=context)
    total = flr(target.reshape(60, 71, 9, 1).sum(2), guides, PARAMETERS, context=context)
    assert error(groups.sum(2)[..., None], total) < tolerances.WHOLE


@pytest.mark.parametrize("target_type", [np.float16, np.float32])
def test_half_storage(context: Context, target_type: type) -> None:
    target, guides = scene(60, 71, 5, 3)
    target, guides = target.astype(target_type), guides.astype(np.float16)
    target[5, 6], guides[7, 8, 1] = np.inf, np.nan
    guides[20:30, 20:30] = 3e-7  # below the smallest normal half
    assert compare(context, target, guides) < tolerances.WHOLE


@pytest.mark.parametrize("channels", [3, 4])
def test_half_output(context: Context, channels: int) -> None:
    target, guides = scene(60, 71, 5, channels)
    guides[:10] *= 1e-6
    target *= np.logspace(-9, 6, 71, dtype=np.float32)[:, None]  # from below half's range to above
    out = np.empty(target.shape, np.float16)
    assert flr(target, guides, PARAMETERS, context=context, out=out) is out
    with np.errstate(over="ignore"):
        right = flr(target, guides, PARAMETERS, context=context).astype(np.float16)
    np.testing.assert_array_equal(out, right)


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_driven_as_a_gpu(gpu_like: Context, dtype: type) -> None:
    target, guides = (a.astype(dtype) for a in scene(43, 101, 5, 3))
    assert compare(gpu_like, target, guides) < tolerances.WHOLE


def test_real_frames(context: Context, data: Path) -> None:
    program = in_float64(jax_flr, method=DEFAULT)
    for path in sorted(data.glob("*/*.exr")):
        frame = jflnr.read_frame(path, spp=1)
        layers = tuple(np.asarray(a) for a in guide_layers.layers(frame, guide_layers.DEFAULT))
        weight = np.asarray(frame.mask)[..., 0] > 0
        found = flr(frame.indirect, layers, DEFAULT, weight=weight, context=context)
        right = program(np.asarray(frame.indirect), layers, weight=weight)
        assert error(found, right) < tolerances.WHOLE
