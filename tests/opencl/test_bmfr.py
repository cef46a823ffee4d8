"""BMFR's kernels against `jflnr.temporal.bmfr`, phase by phase and over a short sequence."""

import dataclasses
import types
from typing import Any

import numpy as np
import pytest

import jflnr
from jflnr.bmfr import pipeline as bmfr
from jflnr.opencl import Context
from jflnr.opencl import bmfr as kernels
from jflnr.opencl.profile import profile
from tests.opencl import tolerances
from tests.opencl.conftest import error
from tests.temporal.bmfr_shot import shot

# In the first frame `fitted` is phase II alone.
PHASES = {"light": "I", "samples": "I", "fitted": "II and III", "picture": "III"}


@pytest.fixture(scope="module")
def frames() -> list[jflnr.Frame]:
    """With lost samples, a guide that is not finite, and unknown motion."""
    frames = shot(4, 45, 70)
    light, position = frames[1].indirect.copy(), frames[2].position.copy()
    light[10:14, 20:31] = np.nan
    position[40, 41] = np.inf
    motion = np.where(frames[3].mask > 0, frames[3].motion, np.nan)
    frames[1] = dataclasses.replace(frames[1], indirect=light)
    frames[2] = dataclasses.replace(frames[2], position=position)
    frames[3] = dataclasses.replace(frames[3], motion=motion)
    return frames


def compare(context: Context, frames: list[jflnr.Frame], **options: Any) -> None:
    """Both over the same frames, each with its own history."""
    settings = bmfr.BMFR(**options)
    ours, right = kernels.start(frames[0], context), bmfr.start(frames[0])
    for frame in frames:
        ours, found = kernels.step(ours, frame, settings, context=context)
        right, image = bmfr.step(right, frame, settings)
        assert error(found, np.asarray(image)) < tolerances.BMFR
        for name, phase in PHASES.items():
            one, other = getattr(ours, name).get(), np.asarray(getattr(right, name))
            assert error(one, other) < tolerances.BMFR, (name, phase)
    assert ours.number == right.number == len(frames)


@pytest.mark.parametrize("block", [16, 32, 64])
def test_a_sequence(context: Context, frames: list[jflnr.Frame], block: int) -> None:
    compare(context, frames, block=block)


def test_light_near_the_end_of_the_type(context: Context, frames: list[jflnr.Frame]) -> None:
    """A fit is linear in light, also where sums over a block would leave float32."""
    frame, large = frames[0], 2.0**120
    bright = dataclasses.replace(frame, indirect=frame.indirect * np.float32(large))
    wanted, found = (
        kernels.step(kernels.start(one, context), one, context=context)[1]
        for one in (frame, bright)
    )
    np.testing.assert_array_equal(found / large, wanted)


@pytest.mark.parametrize("size", [(1, 1), (64, 7)])
def test_sizes(context: Context, size: tuple[int, int]) -> None:
    compare(context, shot(2, *size), block=16)


def test_without_position(context: Context, frames: list[jflnr.Frame]) -> None:
    compare(context, [dataclasses.replace(f, position=None, mask=None) for f in frames[:2]])


def test_driven_as_a_gpu(
    gpu_like: Context, frames: list[jflnr.Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four work-items to a block, whose matrix is more than the local memory holds."""
    device = types.SimpleNamespace(local_mem_size=32768, max_work_group_size=4)
    monkeypatch.setattr(gpu_like, "device", device)
    compare(gpu_like, frames[:2])


def test_a_plane_is_nan_without_noise_and_not_with_it(context: Context) -> None:
    frame = shot(1, 40, 40)[0]
    for noise, sound in ((0.0, False), (0.01, True)):
        method = bmfr.BMFR(noise=noise)
        _, image = kernels.step(kernels.start(frame, context), frame, method, context=context)
        assert np.isfinite(image).all() == sound


def test_runs_agree_to_the_bit(context: Context, frames: list[jflnr.Frame]) -> None:
    images = [
        kernels.step(kernels.start(frames[0], context), frames[0], context=context)[1]
        for _ in range(3)
    ]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])


def test_every_kernel_has_a_row(context: Context, frames: list[jflnr.Frame]) -> None:
    """Those of the paper's Table 4."""
    history = kernels.start(frames[0], context)
    work = lambda: kernels.step(history, frames[0], context=context)
    rows = [row.kernel for row in profile(context, work, repeats=1)]
    table_4 = ["accumulate_light", "fit", "weighted_sum", "accumulate_fitted", "taa"]
    assert rows == [*table_4, "all kernels", "copy"]
