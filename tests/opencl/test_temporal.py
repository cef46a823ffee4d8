"""Denoising with a history on a device against `jflnr.temporal`, over short sequences."""

import dataclasses

import jax
import numpy as np
import pytest

import jflnr
from jflnr import temporal
from jflnr.opencl import Context
from jflnr.opencl import temporal as kernels
from jflnr.temporal.change import BLOCK
from tests.opencl import tolerances
from tests.opencl.conftest import QUICK, error
from tests.temporal.bmfr_shot import shot

GUIDES = ("normal", "depth")
step = jax.jit(temporal.step, static_argnames=("method", "guides"), compiler_options=QUICK)


@pytest.fixture(scope="module")
def frames() -> list[jflnr.Frame]:
    """Of a light that is switched on, with lost samples, and unknown motion."""
    frames = shot(4, 45, 70)
    for i, factor in ((1, 1), (2, 4), (3, 4)):
        light = factor * frames[i].indirect
        light[10:14, 20:31] = np.nan if i == 1 else light[10:14, 20:31]
        motion = np.where((np.arange(45) < 5)[:, None, None] & (i == 3), np.nan, frames[i].motion)
        motion = motion.astype(np.float32)
        frames[i] = dataclasses.replace(frames[i], indirect=light, motion=motion)
    return frames


def compare(context: Context, frames: list[jflnr.Frame], method: str) -> None:
    """Both over the same frames, each with its own history."""
    ours, right = kernels.start(frames[0], context), temporal.start(frames[0])
    height, width = (-(-size // BLOCK) for size in frames[0].indirect.shape[:2])
    for frame in frames:
        ours, found = kernels.step(ours, frame, method, guides=GUIDES, context=context)
        right, image = step(right, frame, method, guides=GUIDES)
        assert error(found, np.asarray(image)) < tolerances.ADAPTIVE
        for one, other in zip(
            (*ours.light, *ours.image), (*right.light, *right.image), strict=True
        ):
            assert error(one.get(), np.asarray(other)) < tolerances.ADAPTIVE
        evidence = ours.evidence.get().transpose(2, 0, 1, 3).reshape(2, height, -1)[..., :width]
        assert error(evidence, np.stack(right.evidence)) < tolerances.ADAPTIVE


@pytest.mark.parametrize("method", ["flr", "flr-adaptive"])
def test_a_sequence(context: Context, frames: list[jflnr.Frame], method: str) -> None:
    compare(context, frames, method)


@pytest.mark.parametrize("size", [(1, 1), (64, 7)])
def test_sizes(context: Context, size: tuple[int, int]) -> None:
    compare(context, shot(2, *size), "flr")


def test_without_position_and_mask(context: Context, frames: list[jflnr.Frame]) -> None:
    compare(context, [dataclasses.replace(f, position=None, mask=None) for f in frames[:2]], "flr")


def test_driven_as_a_gpu(gpu_like: Context, frames: list[jflnr.Frame]) -> None:
    compare(gpu_like, frames[:3], "flr")


def test_a_result_on_the_device_is_the_history(context: Context, frames: list[jflnr.Frame]) -> None:
    first = kernels.start(frames[0], context), frames[0], "flr"
    state, image = kernels.step(*first, guides=GUIDES, context=context, on_device=True)
    again = kernels.step(*first, guides=GUIDES, context=context)[1]
    np.testing.assert_array_equal(image.get(), again)
    np.testing.assert_array_equal(state.image.mean.get(), again)


def test_frames_of_another_size_are_refused(context: Context, frames: list[jflnr.Frame]) -> None:
    state = kernels.start(frames[0], context)
    with pytest.raises(ValueError, match="another size"):
        kernels.step(state, shot(1, 20, 20)[0], "flr", guides=GUIDES, context=context)
