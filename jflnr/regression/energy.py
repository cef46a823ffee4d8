"""Keeping the mean radiance of the frame that the weights would lower."""

from __future__ import annotations

from jflnr.lazy import jax, jnp
from jflnr.regression.division import divide
from jflnr.regression.level import brightness, mean_guides, predict
from jflnr.regression.moments import index_xy
from jflnr.regression.resampling import halve


def restore(
    coefficients: jax.Array, moments: jax.Array, guides: int, slack: jax.Array | float
) -> jax.Array:
    """Scale the models block by block so that the frame's brightness is close to the input's.

    Weights that fall with brightness lose light where it varies inside a window, on its bright
    side; so what is missing is given back in proportion to the square of the brightness. Only
    as much is given as brings the sum within `slack` of the input's.

    coefficients: `(Q + 1, C, h, w)`. moments: unweighted, of the brightness alone, at half the
    resolution. slack: a share, such as 0.025. Returns scaled coefficients.
    """
    output = block_light(coefficients, moments, guides)
    wanted = jnp.sum(moments[index_xy(0, 0, guides, 1)])
    sums = jnp.sum(moments[0] * output), jnp.sum(moments[0] * output**2)
    return scale(coefficients, output, rate(wanted, *sums, slack))


def block_light(coefficients: jax.Array, moments: jax.Array, guides: int) -> jax.Array:
    """Brightness that the models give each block of `moments`, `(h, w)`; arguments of `restore`."""
    whole = halve(jnp.ones((1, *coefficients.shape[2:]), coefficients.dtype))
    pooled = halve(coefficients.reshape(-1, *coefficients.shape[2:])) / whole
    pooled = pooled.reshape(*coefficients.shape[:2], *whole.shape[1:])
    return jnp.maximum(predict(pooled, mean_guides(moments, guides)), 0)


def rate(
    wanted: jax.Array, before: jax.Array, squares: jax.Array, slack: jax.Array | float
) -> jax.Array:
    """How much of the squared brightness is added: from sums over the frame of the input's
    brightness, of the output's and of its square."""
    wanted = jnp.clip(before, (1 - slack) * wanted, (1 + slack) * wanted)
    return divide(wanted - before, squares)


def scale(coefficients: jax.Array, output: jax.Array, rate: jax.Array) -> jax.Array:
    """Add `rate` times the square of the brightness. output: `(h, w)`, from `block_light`."""
    factor = jnp.maximum(1 + rate * output, 0)
    factor = jnp.repeat(jnp.repeat(factor, 2, axis=0), 2, axis=1)
    return coefficients * factor[: coefficients.shape[2], : coefficients.shape[3]]


def rescale(image: jax.Array, light: jax.Array, weight: jax.Array | None) -> jax.Array:
    """Scale the result so that its brightness sums to the input's over the pixels that count.

    image: `(H, W, C)`. light: `(H, W)`, brightness of the input. weight: `(H, W)` or None.
    """
    counts = jnp.isfinite(light) if weight is None else jnp.isfinite(light) & (weight > 0)
    output = jnp.einsum("hwc,c->hw", image, brightness(image.shape[-1], image.dtype))
    after = jnp.sum(jnp.where(counts, output, 0))
    before = jnp.sum(jnp.where(counts, light, 0))
    return image * jnp.where(after > 0, divide(before, after), 1)
