"""The normalised, regularised least squares of the Appendix (section 3.2, kernel 3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jflnr.regression.elimination import eliminate
from jflnr.regression.moments import index_xx, index_xy

# Roundings that a variance, a difference of two sums, or a pivot may be off by.
ROUNDING = 8
Solver = Literal["cholesky", "block-inverse"]
# So many guides are solved step by step as written out; of more, that compiles for minutes.
WRITTEN_OUT = 8


def solve(
    moments: jax.Array,
    shift: jax.Array,
    method: Any,
    channels: int,
    solver: Solver = "cholesky",
) -> jax.Array:
    """Coefficients of the local affine models, one per block (Appendix, Eq. 12-23).

    The moments are those of X - shift. Eq. 18 reads, with mu the mean of X and W the covariance,
    `W + eps (mu mu^T + diag(mu^2)) + eps' I`; W does not depend on the shift, so it is taken from
    the shifted moments, where it loses no digits, and mu is shifted back. A window without a
    single usable pixel, or whose moments overflow, gets the model 0.

    moments: `(K, h, w)`, blurred. shift: `(Q,)`. channels: the number C of target channels.
    Returns `(Q + 1, C, h, w)`: the value of Y at X = shift, then the slope of each guide.
    """
    eps, eps_prime = (number.astype(moments.dtype) for number in regularisation(method))
    count = shift.size
    n = moments[0]
    filled = (n > 1e-12) & jnp.all(jnp.isfinite(moments), axis=0)
    means = jnp.where(filled, moments, 0) / jnp.where(filled, n, 1)

    # Eq. 13 and 15, about the shift.
    first = np.array([index_xx(i + 1, 0) for i in range(count)], int)
    pairs = np.array([index_xx(i + 1, j + 1) for i, j in np.ndindex(count, count)], int)
    cross = np.array(
        [index_xy(i + 1, c, count, channels) for i, c in np.ndindex(count, channels)], int
    )
    mean_x = means[first]
    mean_y = means[index_xy(0, 0, count, channels) :][:channels]
    covariance = means[pairs.reshape(count, count)] - mean_x[:, None] * mean_x

    # Eq. 18; rounding can leave a flat guide's variance just below zero, and far from the shift no
    # more of it is known than rounding leaves.
    diagonal = jnp.eye(count, dtype=bool)[:, :, None, None]
    covariance = jnp.where(diagonal, jnp.maximum(covariance, 0), covariance)
    unknown = ROUNDING * jnp.finfo(moments.dtype).eps * (covariance + mean_x[:, None] * mean_x)
    mu = mean_x + shift[:, None, None].astype(moments.dtype)
    outer = mu[:, None] * mu
    ridge = eps * outer + eps_prime + unknown
    regular = covariance + eps * outer + jnp.where(diagonal, ridge, 0)

    # Eq. 19 to 22, with a unit diagonal before eps' is added.
    scale = lax.rsqrt(jnp.stack([regular[i, i] for i in range(count)])) if count else mean_x
    correlation = jnp.where(diagonal, 1 + eps_prime, regular * scale[:, None] * scale)
    right = (means[cross.reshape(count, channels)] - mean_x[:, None] * mean_y) * scale[:, None]
    slopes = SOLVERS[solver](correlation, right) * scale[:, None]

    # Eq. 23 as an affine function of X - shift.
    value = mean_y - jnp.sum(mean_x[:, None] * slopes, axis=0)
    return jnp.concatenate([value[None], slopes])


def regularisation(method: Any) -> tuple[jax.Array, jax.Array]:
    """eps and eps', cut where they change nothing more and numbers after them would overflow."""
    return jnp.minimum(method.eps, 1e4), jnp.clip(method.eps_prime, 1e-24, 1e30)


def cholesky_solve(matrix: jax.Array, right: jax.Array) -> jax.Array:
    """Solve `matrix @ a = right` by Cholesky in its root-free form, `matrix = L D L^T`.

    Above `WRITTEN_OUT` guides by elimination, which has the same pivots, in a loop.
    matrix: `(Q, Q, h, w)`, symmetric with a diagonal near 1. right: `(Q, C, h, w)`.
    Returns `(Q, C, h, w)`.
    """
    if matrix.shape[0] > WRITTEN_OUT:
        return eliminate(jnp.concatenate([matrix, right], axis=1))
    steps = []
    while matrix.shape[0]:
        pivot, row, first = matrix[0, 0], matrix[0, 1:], right[0]
        inverse = _inverse_pivot(pivot)
        steps.append((inverse, row, first))
        factor = row * inverse
        matrix = matrix[1:, 1:] - factor[:, None] * row
        right = right[1:] - factor[:, None] * first
    solution = right
    for inverse, row, first in reversed(steps):
        known = jnp.sum(row[:, None] * solution, axis=0)
        solution = jnp.concatenate([((first - known) * inverse)[None], solution])
    return solution


def _inverse_pivot(pivot: jax.Array) -> jax.Array:
    """A pivot that is no larger than the rounding error belongs to a guide that the ones before it
    already explain: 0, and so is that guide's slope."""
    clear = pivot > ROUNDING * jnp.finfo(pivot.dtype).eps
    return jnp.where(clear, 1 / jnp.where(clear, pivot, 1), 0)


def block_inverse_solve(matrix: jax.Array, right: jax.Array) -> jax.Array:
    """Solve by the paper's recursive block-matrix inverse (Appendix, first formula).

    Of guides alike the products nearly cancel, each far above their sum: so they are of numbers
    near 1, also where the light is near the type's maximum.
    """
    largest = jnp.max(jnp.abs(lax.stop_gradient(right)), axis=0, initial=0)
    unit = jnp.where(largest > 0, largest, 1)
    return _product(_block_inverse(matrix), right / unit) * unit


def _block_inverse(matrix: jax.Array) -> jax.Array:
    """Inverse of symmetric matrices `(Q, Q, h, w)` by halving them."""
    if matrix.shape[0] <= 1:
        return _inverse_pivot(matrix)
    half = matrix.shape[0] // 2
    a_inverse = _block_inverse(matrix[:half, :half])
    a_inverse_b = _product(a_inverse, matrix[:half, half:])
    schur = matrix[half:, half:] - _product(matrix[half:, :half], a_inverse_b)
    schur_inverse = _block_inverse(schur)
    upper_right = -_product(a_inverse_b, schur_inverse)
    upper_left = a_inverse - _product(upper_right, jnp.swapaxes(a_inverse_b, 0, 1))
    lower_left = jnp.swapaxes(upper_right, 0, 1)
    top = jnp.concatenate([upper_left, upper_right], axis=1)
    return jnp.concatenate([top, jnp.concatenate([lower_left, schur_inverse], axis=1)])


def _product(a: jax.Array, b: jax.Array) -> jax.Array:
    """Matrix product over the first two axes."""
    return jnp.sum(a[:, :, None] * b, axis=1)


SOLVERS: dict[str, Callable[[jax.Array, jax.Array], jax.Array]] = {
    "cholesky": cholesky_solve,
    "block-inverse": block_inverse_solve,
}
