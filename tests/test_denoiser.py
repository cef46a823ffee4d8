"""`Denoiser`: where its results go, and frame by frame."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr import temporal
from jflnr.frame import Frame

WAYS = {"whole": {}, "tiles": {"tile": 16}, "opencl": {"backend": "opencl"}}


@pytest.fixture(params=WAYS)
def denoiser(request: pytest.FixtureRequest) -> jflnr.Denoiser:
    if request.param == "opencl":
        from jflnr.opencl import NoDevice, all_devices

        try:
            all_devices()
        except NoDevice as error:
            pytest.skip(str(error))
    return jflnr.Denoiser("flr", block=4, **WAYS[request.param])


@pytest.fixture
def still(frame: Frame) -> Frame:
    return dataclasses.replace(frame, motion=np.zeros_like(frame.motion))


def test_the_result_is_of_the_frames_kind(denoiser: jflnr.Denoiser, still: Frame) -> None:
    there = jax.tree.map(jnp.asarray, still)
    for call in (denoiser, denoiser.next):
        assert isinstance(call(still), np.ndarray)
        assert isinstance(call(there), jax.Array)
    np.testing.assert_allclose(denoiser(there), denoiser(still), rtol=1e-4, atol=1e-5)


def test_the_result_is_written_where_one_says(denoiser: jflnr.Denoiser, still: Frame) -> None:
    right = denoiser(still)
    for given in (still, jax.tree.map(jnp.asarray, still)):
        out = np.full(still.indirect.shape, np.nan, np.float32)
        assert denoiser(given, out) is out
        np.testing.assert_allclose(out, right, rtol=1e-4, atol=1e-5)
    out = np.full_like(out, np.nan)
    assert denoiser.next(still, out) is out and np.isfinite(out).all()


def test_next_is_the_step_of_a_shot(denoiser: jflnr.Denoiser, still: Frame) -> None:
    state = temporal.start(still)
    for factor in (1, 2, 2):
        frame = dataclasses.replace(still, indirect=factor * still.indirect)
        state, right = temporal.step(state, frame, "flr", block=4)
        np.testing.assert_allclose(denoiser.next(frame), right, rtol=1e-3, atol=1e-3)
    denoiser.state = None
    np.testing.assert_allclose(denoiser.next(still), denoiser(still), rtol=1e-3, atol=1e-4)
