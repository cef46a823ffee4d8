"""The regularised least squares of `solve.py` for many blocks: strip by strip, by elimination.

The same equations (Appendix, Eq. 12-23) with regularisation that differs from block to block. A few
rows of blocks at a time stay in the cache, and Gauss-Jordan elimination is one short loop, which
compiles in a fraction of the time that a factorisation written out takes.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jflnr.regression.moments import index_xx, index_xy

# Roundings of a sum of squares that may add up.
ROUNDING = 64
# Blocks that are solved at a time.
STRIP = 4096


def solve_strips(
    moments: jax.Array, shift: jax.Array, eps: jax.Array, eps_prime: jax.Array, channels: int
) -> jax.Array:
    """Coefficients of the local affine models, as from `solve`.

    moments: `(K, h, w)`. shift: `(Q,)`. eps, eps_prime: `(h, w)`, multiplicative and additive
    regularisation. channels: the number C of target channels. Returns `(Q + 1, C, h, w)`.
    """
    height, width = moments.shape[1:]
    rows = min(max(STRIP // width, 1), height)
    regular = jnp.stack([eps, eps_prime])

    def solve_some(strip: jax.Array, models: jax.Array) -> jax.Array:
        # The last strip ends with the grid; what it shares with the one before is the same.
        first = jnp.minimum(strip * rows, height - rows)
        some, own = (lax.dynamic_slice_in_dim(a, first, rows, axis=1) for a in (moments, regular))
        some, own = lax.optimization_barrier((some, own))
        solved = _solve(some, own, shift, channels)
        return lax.dynamic_update_slice_in_dim(models, solved, first, axis=2)

    models = jnp.zeros((shift.size + 1, channels, height, width), moments.dtype)
    return lax.fori_loop(0, -(-height // rows), solve_some, models)


def _solve(moments: jax.Array, regular: jax.Array, shift: jax.Array, channels: int) -> jax.Array:
    system = normal_equations(moments, shift, regular[0], regular[1], channels)
    if not shift.size:
        return system.mean_y[None]
    both = jnp.concatenate([system.correlation, system.right], axis=1)
    slopes = eliminate(both) * system.scale[:, None]
    value = system.mean_y - jnp.sum(system.mean_x[:, None] * slopes, axis=0)
    return jnp.concatenate([value[None], slopes])


class NormalEquations(NamedTuple):
    """`correlation @ (slopes / scale) = right`, and the means that the models pass through.

    correlation: `(Q, Q, h, w)`. right: `(Q, C, h, w)`. scale, mean_x: `(Q, h, w)`. mean_y:
    `(C, h, w)`.
    """

    correlation: jax.Array
    right: jax.Array
    scale: jax.Array
    mean_x: jax.Array
    mean_y: jax.Array


def normal_equations(
    moments: jax.Array, shift: jax.Array, eps: jax.Array, eps_prime: jax.Array, channels: int
) -> NormalEquations:
    """Eq. 13 to 22; arguments as of `solve_strips`."""
    count = shift.size
    filled = moments[0] > 1e-12
    means = moments * jnp.where(filled, 1 / jnp.where(filled, moments[0], 1), 0)
    xx = (count + 1) * (count + 2) // 2
    mean_x = means[np.array([index_xx(i + 1, 0) for i in range(count)], int)]
    mean_y = means[index_xy(0, 0, count, channels) :][:channels]
    pairs = np.array([index_xx(i + 1, j + 1) for i, j in np.ndindex(count, count)], int)
    diagonal = jnp.eye(count, dtype=bool)[:, :, None, None]
    covariance = means[pairs.reshape(count, count)] - mean_x[:, None] * mean_x
    covariance = jnp.where(diagonal, jnp.maximum(covariance, 0), covariance)
    mu = mean_x + shift[:, None, None].astype(means.dtype)
    outer = eps * mu[:, None] * mu
    # Of a narrow window far from the shift, no more of the variance is known than this.
    rounding = ROUNDING * jnp.finfo(means.dtype).eps * (covariance + mean_x[:, None] * mean_x)
    regular = covariance + outer + jnp.where(diagonal, outer + eps_prime + rounding, 0)

    scale = lax.rsqrt(jnp.stack([regular[i, i] for i in range(count)])) if count else mean_x
    correlation = jnp.where(diagonal, 1 + eps_prime, regular * scale[:, None] * scale)
    cross = means[xx + channels :].reshape(count, channels, *means.shape[1:])
    right = (cross - mean_x[:, None] * mean_y) * scale[:, None]
    return NormalEquations(correlation, right, scale, mean_x, mean_y)


def eliminate(system: jax.Array) -> jax.Array:
    """Solve `[matrix, right]`, `(Q, Q + C, ...)`, by Gauss-Jordan elimination: `(Q, C, ...)`.

    The matrix is symmetric with a diagonal near 1, and needs no search for pivots.
    A pivot no larger than the rounding error belongs to a guide that others already explain: its
    slope is 0.
    """
    count = system.shape[0]

    def step(k: jax.Array, system: jax.Array) -> jax.Array:
        row = lax.dynamic_index_in_dim(system, k, 0, keepdims=False)
        column = lax.dynamic_index_in_dim(system, k, 1, keepdims=False)
        pivot = lax.dynamic_index_in_dim(row, k, 0, keepdims=False)
        clear = pivot > 8 * jnp.finfo(pivot.dtype).eps
        row = row * jnp.where(clear, 1 / jnp.where(clear, pivot, 1), 0)
        is_row = (jnp.arange(count) == k).reshape(-1, *(1,) * pivot.ndim)
        column = jnp.where(is_row, -1, column)
        kept = jnp.where(is_row[:, None], 0, system)
        return kept - column[:, None] * row

    return lax.fori_loop(0, count, step, system)[:, count:]
