"""Solvers of many small symmetric systems at once, each with a diagonal near 1.

No search for pivots is needed. A pivot no larger than the rounding error belongs to a guide that
the ones before it already explain: that guide's slope is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.division import divide

Solver = Literal["cholesky", "block-inverse"]
Solve: TypeAlias = "Callable[[jax.Array, jax.Array], jax.Array]"
# Roundings that a pivot may be off by.
ROUNDING = 8
# So many guides are solved step by step as written out; of more, that compiles for minutes.
WRITTEN_OUT = 8


def inverse_pivot(pivot: jax.Array) -> jax.Array:
    """One over a pivot, 0 if it is no larger than the rounding error."""
    return divide(1, pivot, ROUNDING * jnp.finfo(pivot.dtype).eps)


def by_its_equation(solver: Solve, matrix: jax.Array, right: jax.Array) -> jax.Array:
    """`solver(matrix, right)`, with the derivative of the equation, `A dx = db - dA x`, in place of
    that of the solver's steps: the same number, which compiles in a fraction of the time.

    matrix: `(Q, Q, h, w)`, symmetric. right: `(Q, C, h, w)`. Returns `(Q, C, h, w)`.
    """
    return lax.custom_linear_solve(
        lambda x: _product(matrix, x), right, lambda _, b: solver(matrix, b), symmetric=True
    )


def eliminate(matrix: jax.Array, right: jax.Array) -> jax.Array:
    """Solve `matrix @ a = right` by Gauss-Jordan elimination: one short loop, which compiles fast.

    matrix: `(Q, Q, ...)`. right: `(Q, C, ...)`. Returns `(Q, C, ...)`.
    """
    count = matrix.shape[0]
    if not count:
        return right
    number = jnp.arange(count).reshape(-1, *(1,) * (matrix.ndim - 2))

    def step(k: jax.Array, system: jax.Array) -> jax.Array:
        row, column = (lax.dynamic_index_in_dim(system, k, axis, False) for axis in (0, 1))
        row = row * inverse_pivot(lax.dynamic_index_in_dim(row, k, 0, False))
        is_row = number == k
        kept = jnp.where(is_row[:, None], 0, system)
        return kept - jnp.where(is_row, -1, column)[:, None] * row

    both = jnp.concatenate([matrix, right], axis=1)
    return lax.fori_loop(0, count, step, both)[:, count:]


def cholesky_solve(matrix: jax.Array, right: jax.Array) -> jax.Array:
    """Solve `matrix @ a = right` by Cholesky in its root-free form, `matrix = L D L^T`.

    Above `WRITTEN_OUT` guides by elimination, which has the same pivots, in a loop.
    matrix: `(Q, Q, h, w)`, symmetric with a diagonal near 1. right: `(Q, C, h, w)`.
    Returns `(Q, C, h, w)`.
    """
    if matrix.shape[0] > WRITTEN_OUT:
        return eliminate(matrix, right)
    steps = []
    while matrix.shape[0]:
        pivot, row, first = matrix[0, 0], matrix[0, 1:], right[0]
        inverse = inverse_pivot(pivot)
        steps.append((inverse, row, first))
        factor = row * inverse
        matrix = matrix[1:, 1:] - factor[:, None] * row
        right = right[1:] - factor[:, None] * first
    solution = right
    for inverse, row, first in reversed(steps):
        known = jnp.sum(row[:, None] * solution, axis=0)
        solution = jnp.concatenate([((first - known) * inverse)[None], solution])
    return solution


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
        return inverse_pivot(matrix)
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


SOLVERS: dict[str, Solve] = {"cholesky": cholesky_solve, "block-inverse": block_inverse_solve}
