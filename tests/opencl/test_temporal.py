"""Denoising with a history on a device against `jflnr.temporal`, over short sequences."""

import dataclasses
from collections.abc import Callable

import jax
import numpy as np
import pytest

import jflnr
from jflnr import temporal
from jflnr.denoising import SHIPPED_FRAME
from jflnr.images.inputs import prepare, robust_images
from jflnr.methods import method_of
from jflnr.opencl import Context
from jflnr.opencl import temporal as kernels
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.flnr import flnr
from jflnr.opencl.twins import filters_on
from jflnr.temporal.change import BLOCK
from tests.opencl import tolerances
from tests.opencl.conftest import error
from tests.temporal.bmfr_shot import shot

GUIDES = ("normal", "depth")


@pytest.fixture(scope="module")
def frames() -> list[jflnr.Frame]:
    """Of a light that is switched on, with lost samples, unknown motion, and walls that turn and
    slide by some pixels."""
    frames = shot(4, 45, 70)
    for i, frame in enumerate(frames):
        sine, cosine = np.sin(0.2 * i), np.cos(0.2 * i)
        turn = np.float32([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
        slid = frame.position + np.float32([0.025 * i, 0, 0])
        frames[i] = dataclasses.replace(frame, normal=frame.normal @ turn, position=slid)
    for i, factor in ((1, 1), (2, 4), (3, 4)):
        light = factor * frames[i].indirect
        light[10:14, 20:31] = np.nan if i == 1 else light[10:14, 20:31]
        motion = np.where((np.arange(45) < 5)[:, None, None] & (i == 3), np.nan, frames[i].motion)
        motion = motion.astype(np.float32)
        frames[i] = dataclasses.replace(frames[i], indirect=light, motion=motion)
    return frames


def compare(context: Context, frames: list[jflnr.Frame]) -> None:
    """`flr` by both over the same frames, each with its own history."""
    ours = kernels.start(frames[0], "flr", guides=GUIDES, context=context)
    right = temporal.start(frames[0], "flr", guides=GUIDES)
    height, width = (-(-size // BLOCK) for size in frames[0].indirect.shape[:2])
    for frame in frames:
        ours, found = kernels.step(ours, frame, "flr", guides=GUIDES, context=context)
        right, image = temporal.step(right, frame, "flr", guides=GUIDES)
        assert error(found, np.asarray(image)) < tolerances.ADAPTIVE
        for one, other in zip(
            (*ours.light, ours.guides, *ours.image),
            (*right.light, right.guides, *right.image),
            strict=True,
        ):
            assert error(one.get(), np.asarray(other)) < tolerances.ADAPTIVE
        evidence = ours.evidence.get().transpose(2, 0, 1, 3).reshape(2, height, -1)[..., :width]
        assert error(evidence, np.stack(right.evidence)) < tolerances.ADAPTIVE


def test_a_sequence(context: Context, frames: list[jflnr.Frame]) -> None:
    compare(context, frames)


@pytest.mark.parametrize(("method", "alone"), [("flr-adaptive", flr_adaptive), ("flnr", flnr)])
def test_the_first_frame_is_denoised_as_by_itself(
    context: Context, method: str, alone: Callable[..., np.ndarray]
) -> None:
    frame = jflnr.read_frame(SHIPPED_FRAME)
    frame = jax.tree.map(lambda layer: layer[90:154, 150:246], frame)
    frame = dataclasses.replace(frame, motion=np.zeros((64, 96, 2), np.float32))
    found = kernels.step(kernels.start(frame, context=context), frame, method, context=context)[1]
    filters = filters_on(context)
    images = robust_images(*prepare(frame, None, method_of(method))[::-1], filters=filters)
    right = alone(
        images["target"],
        images["guides"],
        method_of(method),
        weight=images["weight"],
        context=context,
    )
    assert error(found, right) < tolerances.WHOLE


def test_narrow_frames_without_position_and_mask(context: Context) -> None:
    """Narrower than a vector; surfaces are told apart by depth."""
    compare(context, [dataclasses.replace(f, position=None, mask=None) for f in shot(2, 64, 7)])


def test_driven_as_a_gpu(gpu_like: Context, frames: list[jflnr.Frame]) -> None:
    compare(gpu_like, frames[:3])


def test_a_result_on_the_device_is_the_history(context: Context, frames: list[jflnr.Frame]) -> None:
    start = kernels.start(frames[0], "flr", guides=GUIDES, context=context)
    first = start, frames[0], "flr"
    state, image = kernels.step(*first, guides=GUIDES, context=context, on_device=True)
    again = kernels.step(*first, guides=GUIDES, context=context)[1]
    np.testing.assert_array_equal(image.get(), again)
    np.testing.assert_array_equal(state.image.mean.get(), again)


def test_frames_of_another_size_are_refused(context: Context, frames: list[jflnr.Frame]) -> None:
    state = kernels.start(frames[0], "flr", guides=GUIDES, context=context)
    with pytest.raises(ValueError, match="another size"):
        kernels.step(state, shot(1, 20, 20)[0], "flr", guides=GUIDES, context=context)
