"""What every block counts: one over the variance that a first fit expects of its light."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.auto.collected import Collected
from jflnr.regression.adaptive import DEFAULT
from jflnr.regression.level import Grid, fit_level, mean_guides, predict
from jflnr.regression.moments import index_xx
from jflnr.regression.resampling import double, halve

# Chosen on train and val. Blocks differ less from their pixels than pixels do, so weights may fall
# more steeply with brightness than in adaptive FLR.
SETTINGS = dataclasses.replace(DEFAULT, sigma=2.2, exponent=1.5, offset=0.1, brightness_scale=1.8)
# Side in pixels of the blocks of the first fit.
FIRST = 16


def weigh(
    collected: Collected, light: jax.Array, mean: jax.Array, block: int
) -> tuple[jax.Array, jax.Array]:
    """Weights `(h, w)` of the blocks, and the mean squares `(1, h, w)` of what the fit leaves.

    light: moments of the brightness. mean: brightness of the frame. block: side in pixels of the
    blocks of `collected`.
    """
    count = collected.shift.size
    pilot = _first_fit(light, collected.shift, mean, block)
    luminance = predict(pilot, mean_guides(light, count))
    squares = squared_residual(light, collected.squares, pilot[:, 0])
    # The bound is there for the derivative of the power at 0.
    relative = jnp.maximum(luminance / mean, 1e-6)
    return 1 / (relative**SETTINGS.exponent + SETTINGS.offset), squares[None]


def weighted(collected: Collected, weights: jax.Array, squares: jax.Array, block: int) -> Grid:
    """The blocks with their weights, from `weigh`."""
    return Grid(collected.moments * weights, squares * weights**2, block)


def _first_fit(light: jax.Array, shift: jax.Array, mean: jax.Array, block: int) -> jax.Array:
    """Models of the brightness under wide windows, on the blocks of `light`."""
    sizes = [light.shape[1:]]
    while block < FIRST:
        light, block = halve(light), 2 * block
        sizes.append(light.shape[1:])
    grid = Grid(light, jnp.zeros_like(light[:1]), block)
    coefficients = fit_level(grid, shift, 1, mean, SETTINGS).coefficients
    for size in reversed(sizes[:-1]):
        coefficients = double(coefficients, *size)
    return coefficients


def squared_residual(light: jax.Array, squares: jax.Array, model: jax.Array) -> jax.Array:
    """Mean square of brightness minus model, `(h, w)`, from moments: yy - 2 a.xy + a.xx.a.

    light: moments of the brightness. squares: `(h, w)`. model: `(Q + 1, h, w)`.
    """
    count = model.shape[0]
    pairs = np.array([[index_xx(i, j) for j in range(count)] for i in range(count)])
    cross = light[count * (count + 1) // 2 :]
    fitted = jnp.einsum("ijhw,jhw->ihw", light[pairs], model)
    return jnp.maximum(squares + jnp.sum(model * (fitted - 2 * cross), axis=0), 0)
