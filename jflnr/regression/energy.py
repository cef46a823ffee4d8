"""Keeping the mean radiance of the frame that the weights would lower."""

from __future__ import annotations

from jflnr.lazy import jax, jnp
from jflnr.regression.division import divide
from jflnr.regression.level import mean_guides, predict
from jflnr.regression.resampling import halve_inside


def block_light(coefficients: jax.Array, moments: jax.Array, guides: int) -> jax.Array:
    """Brightness that the models give each block of `moments`, `(h, w)`.

    coefficients: `(Q + 1, C, h, w)`. moments: unweighted, of the brightness alone, at half the
    resolution.
    """
    pooled = halve_inside(coefficients)
    return jnp.maximum(predict(pooled, mean_guides(moments, guides)), 0)


def rate(
    wanted: jax.Array, before: jax.Array, squares: jax.Array, slack: jax.Array | float
) -> jax.Array:
    """How much of the squared brightness is added, from sums over the frame of the input's
    brightness, of the output's and of its square.

    Weights that fall with brightness lose light where it varies inside a window, on its bright
    side; so what is missing is given back in proportion to the square of the brightness. Only
    as much is given as brings the sum within `slack` of the input's.
    """
    wanted = jnp.clip(before, (1 - slack) * wanted, (1 + slack) * wanted)
    return divide(wanted - before, squares)


def scale(coefficients: jax.Array, output: jax.Array, rate: jax.Array) -> jax.Array:
    """Add `rate` times the square of the brightness. output: `(h, w)`, from `block_light`."""
    factor = jnp.maximum(1 + rate * output, 0)
    factor = jnp.repeat(jnp.repeat(factor, 2, axis=0), 2, axis=1)
    return coefficients * factor[: coefficients.shape[2], : coefficients.shape[3]]
