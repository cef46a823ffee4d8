"""Averages over time: what weight each frame has in them, found by feeding one-hot frames."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.temporal import Average, Taps, accumulate, reproject
from jflnr.temporal.accumulate import nothing

FRAMES = 12
accumulate_jit = jax.jit(accumulate)


def weights_of_frames(least: float) -> tuple[np.ndarray, float]:
    """The weight of each frame in the average after the last, and its number of samples."""
    average = nothing(1, 1, FRAMES)
    for frame in np.eye(FRAMES, dtype=np.float32):
        average = accumulate_jit(average, frame[None, None], least)
    return np.asarray(average.mean)[0, 0], float(average.samples[0, 0, 0])


def test_at_first_every_frame_counts_alike() -> None:
    weights, samples = weights_of_frames(0.0)
    np.testing.assert_allclose(weights, 1 / FRAMES, rtol=1e-5)
    assert samples == pytest.approx(FRAMES)


def test_then_old_frames_fade() -> None:
    """With a least share of 0.2: a plain mean of 5 frames, which fades by 0.8 in each later one."""
    ages = np.arange(FRAMES)[::-1]
    wanted = np.where(np.arange(FRAMES) < 5, 0.2 * 0.8 ** (FRAMES - 5), 0.2 * 0.8**ages)
    weights, _ = weights_of_frames(0.2)
    np.testing.assert_allclose(weights, wanted, rtol=1e-5)


@pytest.mark.parametrize("least", [0.0, 0.2, 0.5, 1.0])
def test_samples_tell_the_variance(least: float) -> None:
    """The variance of a weighted mean of equally noisy frames is the sum of squared weights."""
    weights, samples = weights_of_frames(least)
    assert weights.sum() == pytest.approx(1)
    assert samples == pytest.approx(1 / np.sum(weights**2), rel=1e-5)


def test_what_is_not_finite_changes_nothing() -> None:
    average = Average(jnp.full((1, 3, 2), 4.0), jnp.array([[[2.0], [2.0], [0.0]]]))
    image = np.float32([[[1, 1], [np.nan, 1], [np.inf, 0]]])
    mean, samples = accumulate_jit(average, image, 0.1)
    np.testing.assert_allclose(mean[0], [[3, 3], [4, 4], [4, 4]])
    np.testing.assert_allclose(samples[0, :, 0], [3, 2, 0], rtol=1e-6)


def test_disoccluded_pixels_start_again() -> None:
    before = Average(jnp.full((2, 2, 1), 7.0), jnp.full((2, 2, 1), 30.0))
    pixel = np.tile(np.arange(4, dtype=np.int32).reshape(2, 2, 1), 4)
    weight = np.zeros((2, 2, 4), np.float32)
    weight[0, :, 0] = 1
    moved = reproject(before, Taps(jnp.asarray(pixel), jnp.asarray(weight)))
    mean, samples = accumulate_jit(moved, np.ones((2, 2, 1), np.float32), 0.0)
    np.testing.assert_allclose(mean[..., 0], [[7 - 6 / 31] * 2, [1, 1]], rtol=1e-6)
    np.testing.assert_allclose(samples[..., 0], [[31, 31], [1, 1]], rtol=1e-5)
