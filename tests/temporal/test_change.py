"""What of the difference to the history is signal: on noise of which the truth is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.temporal.change import BLOCK, Evidence, find_change, no_evidence

HEIGHT, WIDTH = 96, 128
Y, X = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32) / WIDTH
GUIDES = np.stack([np.where(X < 0.5, 1, 0), np.where(X < 0.5, 0, 1), 1 + Y], -1).astype(np.float32)
BEFORE = (0.5 + Y + (X < 0.5)).astype(np.float32)
CAUTION = 3.5
NONE = np.zeros_like(BEFORE)

find_jit = jax.jit(find_change)


def sparse_noise(light: np.ndarray, seed: int) -> np.ndarray:
    """One sample per pixel: one in ten hits the light, and tells ten times as much."""
    hit = np.random.default_rng(seed).random((*light.shape, 1)) < 0.1
    return (10 * hit * light[..., None] * np.ones(3)).astype(np.float32)


def follow(
    after: np.ndarray, frames: int, weight: np.ndarray | None = None, scale: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """The history's light after some frames of `after`, with what was found added to it, and how
    much that was in each, of its brightness."""
    history, evidence = BEFORE[..., None] * np.ones(3, np.float32), no_evidence(HEIGHT, WIDTH)
    weight = np.ones_like(BEFORE) if weight is None else weight
    found = []
    for seed in range(frames):
        difference = sparse_noise(after, seed) - history
        change, evidence = find_jit(
            scale * difference, scale * history[..., 1], GUIDES, weight, NONE, evidence, CAUTION
        )
        signal = np.asarray(change.signal) / scale
        found.append(np.mean(np.abs(signal)) / np.mean(history))
        history = history + signal
    return history, np.array(found)


def test_noise_is_no_change() -> None:
    history, found = follow(BEFORE, 6)
    assert found.mean() < 0.03
    np.testing.assert_allclose(history[..., 0], BEFORE, rtol=0.2)


def test_a_light_that_is_switched_on_is_followed() -> None:
    """On one of two walls: the other's light must stay."""
    after = BEFORE * np.where(X < 0.5, 2, 1)
    history, _ = follow(after, 3)
    lit, dark = X < 0.45, X > 0.55
    error = np.abs(history[..., 0] - after)
    assert error[lit].mean() < 0.2 * (after - BEFORE)[lit].mean()
    assert error[dark].mean() < 0.05 * BEFORE[dark].mean()


def test_what_was_found_is_not_found_again() -> None:
    _, found = follow(3 * BEFORE, 8)
    assert found[0] > 1.5 and found[4:].mean() < 0.1


def test_the_unit_of_light_does_not_matter() -> None:
    after = 2 * BEFORE
    np.testing.assert_allclose(follow(after, 2, scale=1e-6)[0], follow(after, 2)[0], rtol=1e-3)


def test_where_there_is_no_history_nothing_is_found() -> None:
    history, found = follow(2 * BEFORE, 1, weight=np.zeros_like(BEFORE))
    np.testing.assert_array_equal(history[..., 0], BEFORE)
    assert found == [0]


def test_a_pixel_that_is_not_finite_does_not_count() -> None:
    difference = sparse_noise(2 * BEFORE, 0) - BEFORE[..., None]
    spoilt = difference.copy()
    spoilt[5, 7] = np.nan
    weight = np.ones_like(BEFORE)
    weight[5, 7] = 0
    evidence = no_evidence(HEIGHT, WIDTH)
    with_nan = find_jit(spoilt, BEFORE, GUIDES, np.ones_like(BEFORE), NONE, evidence, CAUTION)
    without = find_jit(difference, BEFORE, GUIDES, weight, NONE, evidence, CAUTION)
    for found, wanted in zip(jax.tree.leaves(with_nan), jax.tree.leaves(without), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5)


def test_around_what_comes_into_view_the_history_counts_little() -> None:
    new = np.where((Y < 24 / WIDTH) & (X < 24 / WIDTH), 1, NONE)
    inputs = sparse_noise(BEFORE, 0) - BEFORE[..., None], BEFORE, GUIDES
    evidence = no_evidence(HEIGHT, WIDTH)
    with_new = find_jit(*inputs, 1 - new, new, evidence, CAUTION)[0].noise
    np.testing.assert_allclose(with_new[:16, :16], 1, rtol=1e-4)
    assert with_new.max() < 1.001
    np.testing.assert_allclose(with_new[:, 2 * BLOCK :], 0, atol=1e-4)


@pytest.mark.parametrize("size", [(1, 1), (BLOCK + 1, 2 * BLOCK)])
def test_evidence_is_kept_by_blocks(size: tuple[int, int]) -> None:
    evidence = no_evidence(*size)
    assert isinstance(evidence, Evidence)
    assert evidence.power.shape == tuple(-(-s // BLOCK) for s in size)
    assert not jnp.any(evidence.noise)
