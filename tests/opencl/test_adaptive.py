"""Adaptive FLR in OpenCL against JAX: numbers of guides and channels, awkward frames."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
import pytest

from jflnr.images.noisy_guides import smooth_guide as jax_smooth
from jflnr.network.flnr import FLNR
from jflnr.opencl import Context
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.flnr import flnr
from jflnr.opencl.noisy_guides import smooth_guide
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.adaptive import flr_adaptive as jax_adaptive
from tests.opencl import tolerances
from tests.opencl.conftest import error, scene

SIZE = (61, 203)
PARAMETERS = AdaptiveFLR(exponent=0.8)
# Guides that the JAX program is compiled for. One that is zero changes nothing.
MOST = 8


@functools.cache
def by_jax(**options: Any) -> Callable[..., np.ndarray]:
    program = functools.partial(jax_adaptive, method=PARAMETERS, **options)
    compiled = jax.jit(program)
    return lambda *arrays, **named: np.asarray(compiled(*arrays, **named))


def compare(
    context: Context,
    target: np.ndarray,
    guides: np.ndarray,
    weight: np.ndarray | None = None,
    **options: Any,
) -> float:
    found = flr_adaptive(target, guides, PARAMETERS, weight=weight, context=context, **options)
    guides = np.pad(guides, ((0, 0), (0, 0), (0, MOST - guides.shape[2])))
    weight = np.ones(target.shape[:2]) if weight is None else weight
    return error(found, by_jax(**options)(target, guides, weight=weight.astype(np.float32)))


@pytest.mark.parametrize("count", [1, 5, 8])
def test_numbers_of_guides(context: Context, count: int) -> None:
    assert compare(context, *scene(*SIZE, count, 3)) < tolerances.ADAPTIVE


@pytest.mark.parametrize("kind", ["numbers", "mask"])
def test_weights_and_spoiled_pixels(context: Context, kind: str) -> None:
    target, guides = scene(*SIZE, 5, 3)
    weight = np.random.default_rng(0).uniform(-0.5, 1, SIZE).astype(np.float32)
    weight[:24, :70] = 0
    weight[3, 104:107] = np.nan, np.inf, 0
    target[30, 31], target[31, 150, 1], guides[32, 33, 1] = np.nan, np.inf, np.nan
    weight = weight > 0 if kind == "mask" else weight
    assert compare(context, target, guides, weight) < tolerances.ADAPTIVE


def test_evaluated_on_other_guides(context: Context) -> None:
    """By the models and by the network."""
    target, guides = scene(*SIZE, 5, 3)
    mapped, method = np.ascontiguousarray(guides[::-1]), FLNR(size="small")
    found = flnr(target, guides, method, guides_map=mapped, context=context)
    right = jax.jit(jax_adaptive)(target, guides, method, guides_map=mapped)
    assert error(found, np.asarray(right)) < tolerances.WHOLE


def test_exponent_of_one(context: Context) -> None:
    """It is built without the power, and must be where the others end."""
    target, guides = scene(*SIZE, 5, 3)
    found, right = (
        flr_adaptive(target, guides, AdaptiveFLR(exponent=exponent), context=context)
        for exponent in (1.0, 1.000001)
    )
    assert error(found, right) < tolerances.ADAPTIVE


def test_no_light(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 3)
    assert not flr_adaptive(np.zeros_like(target), guides, PARAMETERS, context=context).any()
    target[:, :100] = 0
    assert compare(context, target, guides) < tolerances.ADAPTIVE


def test_nothing_usable_gives_zero(context: Context) -> None:
    target, guides = scene(20, 30, 5, 3)
    assert not flr_adaptive(np.full_like(target, np.nan), guides, PARAMETERS, context=context).any()


def test_energy_is_kept(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 3)
    weight = np.broadcast_to(np.arange(203) > 20, SIZE)
    target[40, 50] = np.inf
    found = flr_adaptive(
        target, guides, PARAMETERS, weight=weight, keep_energy=True, context=context
    )
    counts = np.isfinite(target).all(2) & weight
    luminance = np.array([0.2126, 0.7152, 0.0722])
    before, after = (np.sum(image[counts] @ luminance) for image in (target, found))
    assert abs(after / before - 1) < 1e-5
    plain = flr_adaptive(target, guides, PARAMETERS, weight=weight, context=context)
    assert np.ptp(found / plain) < 1e-5  # one factor for the whole frame


@pytest.mark.parametrize(("keep_energy", "factor"), [(False, 1), (True, 1), (True, 3)])
def test_the_error_is_told(context: Context, keep_energy: bool, factor: int) -> None:
    target, guides = scene(40, 70, 3, 3)
    options: dict[str, Any] = {"with_error": True, "keep_energy": keep_energy}
    if factor > 1:  # of 119 x 208 pixels
        options["guides_map"] = guides.repeat(factor, 0).repeat(factor, 1)[:-1, :-2]
    right = jax.jit(functools.partial(jax_adaptive, **options))(target, guides)
    found = flr_adaptive(target, guides, context=context, **options)
    for one, other in zip(found, right, strict=True):
        assert error(one, np.asarray(other)) < tolerances.ADAPTIVE


def test_light_groups_sum_to_the_sum(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 6)
    groups = flr_adaptive(target, guides, PARAMETERS, context=context)
    total = target[..., :3] + target[..., 3:]
    found = flr_adaptive(total, guides, PARAMETERS, context=context)
    assert error(groups[..., :3] + groups[..., 3:], found) < tolerances.ADAPTIVE


@pytest.mark.parametrize(("size", "block"), [((1, 1), 8), ((9, 13), 2)])
def test_small_frames(context: Context, size: tuple[int, int], block: int) -> None:
    target, guides = scene(*size, 5, 3)
    assert compare(context, target, guides, block=block, levels=3) < tolerances.ADAPTIVE


@pytest.mark.parametrize("block", [6, 12, 16, 24])
def test_blocks(context: Context, gpu_like: Context, block: int) -> None:
    """Vectors across two blocks, one or a part of it give the same as single pixels."""
    target, guides = scene(*SIZE, 5, 3)
    found, right = (
        flr_adaptive(target, guides, PARAMETERS, block=block, context=device)
        for device in (context, gpu_like)
    )
    assert error(found, right) < tolerances.ADAPTIVE


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_driven_as_a_gpu(context: Context, gpu_like: Context, dtype: type) -> None:
    target, guides = (image.astype(dtype) for image in scene(*SIZE, 5, 3))
    layers = tuple(np.ascontiguousarray(a) for a in np.split(guides, [3, 4], axis=2))
    found = flr_adaptive(target, layers, PARAMETERS, keep_energy=True, context=gpu_like)
    right = flr_adaptive(
        np.float32(target), np.float32(guides), PARAMETERS, keep_energy=True, context=context
    )
    assert error(found, right) < tolerances.ADAPTIVE


def test_three_runs_give_equal_bits(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 3)
    runs = [flr_adaptive(target, guides, PARAMETERS, context=context) for _ in range(3)]
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()


def test_result_on_the_device_and_in_half(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 3)
    right = flr_adaptive(target, guides, PARAMETERS, context=context)
    there = [context.array(a) for a in (target, guides)]
    found = flr_adaptive(*there, PARAMETERS, context=context, on_device=True)
    np.testing.assert_array_equal(found.get(), right)
    out = np.empty(target.shape, np.float16)
    for keep_energy in (False, True):
        flr_adaptive(target, guides, PARAMETERS, context=context, out=out, keep_energy=keep_energy)
        right = flr_adaptive(target, guides, PARAMETERS, context=context, keep_energy=keep_energy)
        np.testing.assert_array_equal(out, right.astype(np.float16))


def test_wrong_arguments(context: Context) -> None:
    target, guides = scene(20, 30, 5, 3)
    with pytest.raises(ValueError, match="levels"):
        flr_adaptive(target, guides, PARAMETERS, context=context, levels=0)
    with pytest.raises(ValueError, match="guides has 17 channels"):
        flr_adaptive(target, np.zeros((20, 30, 17), np.float32), PARAMETERS, context=context)


@pytest.mark.parametrize("size", [(37, 83), (1, 1), (16, 32)])
def test_smoothing_of_a_noisy_guide(context: Context, size: tuple[int, int]) -> None:
    random = np.random.default_rng(0)
    normal = random.normal(0, 0.1, (*size, 3)).astype(np.float32)
    depth = random.uniform(1, 1.05, (*size, 1)).astype(np.float32)
    noisy = random.uniform(0, 1, (*size, 1)).astype(np.float32)
    if size[0] > 10:
        noisy[3, 4], noisy[1, 1], normal[2, 2, 1], depth[4, 6] = np.nan, np.inf, np.nan, np.inf
    found = smooth_guide(noisy, normal, depth, context).get()
    right = np.asarray(jax_smooth(noisy, normal, depth))
    np.testing.assert_allclose(found, right, rtol=1e-5)
