"""The floor under the result: no pixel darker than a share of its block's light."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.regression.apply import apply
from jflnr.regression.floor import with_own_light
from jflnr.regression.level import brightness

BLOCK, SHIFT = 4, jnp.zeros(1)


def models(channels: int) -> tuple[np.ndarray, np.ndarray]:
    """Models that are far below zero for some guides, and mean guides `(2, h, w)`."""
    rng = np.random.default_rng(0)
    coefficients = rng.normal(1, 2, (2, channels, 6, 7)).astype(np.float32)
    return coefficients, np.stack([np.ones((6, 7)), rng.random((6, 7))]).astype(np.float32)


def interpolated(own: jax.Array) -> np.ndarray:
    """The light of the blocks at every pixel."""
    return np.asarray(apply(own[None], jnp.zeros((24, 28, 0)), SHIFT[:0], BLOCK))


def test_no_pixel_is_darker_and_brighter_ones_are_left_alone():
    coefficients, means = models(3)
    guides = jnp.asarray(np.random.default_rng(1).random((24, 28, 1)), jnp.float32)
    rows = with_own_light(jnp.asarray(coefficients), jnp.asarray(means))
    image = np.asarray(apply(rows, guides, SHIFT, BLOCK, floor=0.2))
    plain = np.asarray(apply(jnp.asarray(coefficients), guides, SHIFT, BLOCK))

    own = (coefficients * means[:, None]).sum(axis=0)
    weights = np.asarray(brightness(3, jnp.float32))
    own *= np.tensordot(weights, own, 1) > 0
    least = 0.2 * interpolated(jnp.asarray(own)) @ weights
    below = plain @ weights < least
    assert 0.1 < below.mean() < 0.9
    np.testing.assert_allclose((image @ weights)[below], least[below], atol=1e-5)
    np.testing.assert_allclose(image[~below], plain[~below], atol=1e-5)


def test_light_groups_sum_to_the_whole():
    coefficients, means = models(6)
    whole = coefficients[:, :3] + coefficients[:, 3:]
    guides = jnp.asarray(np.random.default_rng(1).random((24, 28, 1)), jnp.float32)
    both, together = (
        apply(with_own_light(jnp.asarray(c), jnp.asarray(means)), guides, SHIFT, BLOCK, floor=0.2)
        for c in (coefficients, whole)
    )
    np.testing.assert_allclose(both[..., :3] + both[..., 3:], together, atol=1e-5)
