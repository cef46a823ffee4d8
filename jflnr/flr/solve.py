"""The normalised, regularised least squares of the Appendix (section 3.2, kernel 3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import jax
import jax.numpy as jnp

from jflnr.flr.moments import index_xx, index_xy
from jflnr.flr.parameters import Parameters

Matrix = list[list[jax.Array]]
Solver = Literal["cholesky", "block-inverse"]


def solve(
    moments: jax.Array,
    shift: jax.Array,
    parameters: Parameters,
    channels: int,
    solver: Solver = "cholesky",
) -> jax.Array:
    """Coefficients of the local affine models, one per block (Appendix, Eq. 12-23).

    The moments are those of X - shift. Eq. 18 reads, with mu the mean of X and W the covariance,
    `W + eps (mu mu^T + diag(mu^2)) + eps' I`; W does not depend on the shift, so it is taken from
    the shifted moments, where it loses no digits, and mu is shifted back. A window without a
    single usable pixel gets the model 0.

    moments: `(K, h, w)`, blurred. shift: `(Q,)`. channels: the number C of target channels.
    Returns `(Q + 1, C, h, w)`: the value of Y at X = shift, then the slope of each guide.
    """
    q, eps, eps_prime = shift.size, parameters.eps, parameters.eps_prime
    eps, eps_prime = eps.astype(moments.dtype), eps_prime.astype(moments.dtype)
    n = moments[0]
    filled = n > 1e-12
    per_pixel = jnp.where(filled, 1 / jnp.where(filled, n, 1), 0)

    def xx(i: int, j: int) -> jax.Array:
        return moments[index_xx(i, j)] * per_pixel

    def xy(i: int, c: int) -> jax.Array:
        return moments[index_xy(i, c, q, channels)] * per_pixel

    centred = [xx(i + 1, 0) for i in range(q)]
    mean = [m + s for m, s in zip(centred, shift, strict=True)]
    mean_y = [xy(0, c) for c in range(channels)]
    w: Matrix = [
        [xx(i + 1, j + 1) - centred[i] * centred[j] + eps * mean[i] * mean[j] for j in range(i + 1)]
        for i in range(q)
    ]
    for i in range(q):
        # Rounding can leave a flat guide's variance just below zero.
        variance = jnp.maximum(w[i][i] - eps * mean[i] ** 2, 0)
        w[i][i] = variance + 2 * eps * mean[i] ** 2 + eps_prime
    scale = [jax.lax.rsqrt(w[i][i]) for i in range(q)]
    correlation: Matrix = [
        [w[i][j] * scale[i] * scale[j] if j < i else 1 + eps_prime for j in range(i + 1)]
        for i in range(q)
    ]
    right = [
        [(xy(i + 1, c) - centred[i] * mean_y[c]) * scale[i] for c in range(channels)]
        for i in range(q)
    ]
    solution = SOLVERS[solver](correlation, right)
    slopes = [[solution[i][c] * scale[i] for c in range(channels)] for i in range(q)]
    value = [
        mean_y[c] - sum((centred[i] * slopes[i][c] for i in range(q)), jnp.zeros_like(n))
        for c in range(channels)
    ]
    return jnp.stack([jnp.stack(row) for row in [value, *slopes]])


def cholesky_solve(matrix: Matrix, right: Matrix) -> Matrix:
    """Solve `matrix @ a = right` by Cholesky, written out over planes.

    matrix: lower triangle, `matrix[i][j]` an `(h, w)` plane. right: rows of planes.
    """
    size = len(matrix)
    lower: Matrix = []
    inverse_diagonal: list[jax.Array] = []
    for i in range(size):
        row: list[jax.Array] = []
        for j in range(i):
            rest = matrix[i][j] - sum(row[k] * lower[j][k] for k in range(j))
            row.append(rest * inverse_diagonal[j])
        pivot = matrix[i][i] - sum(entry * entry for entry in row)
        inverse_diagonal.append(_inverse_root(pivot))
        lower.append(row)
    forward: Matrix = []
    for i in range(size):
        forward.append([
            (b - sum(lower[i][k] * forward[k][c] for k in range(i))) * inverse_diagonal[i]
            for c, b in enumerate(right[i])
        ])  # fmt: skip
    backward: Matrix = [[] for _ in range(size)]
    for i in reversed(range(size)):
        backward[i] = [
            (b - sum(lower[k][i] * backward[k][c] for k in range(i + 1, size)))
            * inverse_diagonal[i]
            for c, b in enumerate(forward[i])
        ]
    return backward


def _inverse_root(pivot: jax.Array) -> jax.Array:
    """1/sqrt of a pivot of a matrix with unit diagonal, where it is above the rounding error.

    A pivot below it belongs to a guide that the earlier ones already explain: it gets slope 0.
    """
    clear = pivot > 8 * jnp.finfo(pivot.dtype).eps
    return jnp.where(clear, jax.lax.rsqrt(jnp.where(clear, pivot, 1)), 0)


def block_inverse_solve(matrix: Matrix, right: Matrix) -> Matrix:
    """Solve by the paper's recursive block-matrix inverse (Appendix, first formula)."""
    inverse = _block_inverse(
        [[matrix[max(i, j)][min(i, j)] for j in range(len(matrix))] for i in range(len(matrix))]
    )
    return _product(inverse, right)


def _block_inverse(matrix: Matrix) -> Matrix:
    """Inverse of a symmetric matrix of planes by halving it."""
    size = len(matrix)
    if size == 0:
        return []
    if size == 1:
        return [[1 / matrix[0][0]]]
    half = size // 2
    a_inverse = _block_inverse([row[:half] for row in matrix[:half]])
    b = [row[half:] for row in matrix[:half]]
    c = [row[:half] for row in matrix[half:]]
    a_inverse_b = _product(a_inverse, b)
    projected = _product(c, a_inverse_b)
    schur = [
        [matrix[half + i][half + j] - projected[i][j] for j in range(size - half)]
        for i in range(size - half)
    ]
    schur_inverse = _block_inverse(schur)
    upper_right = [[-entry for entry in row] for row in _product(a_inverse_b, schur_inverse)]
    lower_left = [list(column) for column in zip(*upper_right, strict=True)]
    correction = _product(upper_right, [list(column) for column in zip(*a_inverse_b, strict=True)])
    upper_left = [
        [a - b for a, b in zip(row, minus, strict=True)]
        for row, minus in zip(a_inverse, correction, strict=True)
    ]
    top = [x + y for x, y in zip(upper_left, upper_right, strict=True)]
    return top + [x + y for x, y in zip(lower_left, schur_inverse, strict=True)]


def _product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, col, strict=True)) for col in columns] for row in a]


SOLVERS: dict[str, Callable[[Matrix, Matrix], Matrix]] = {
    "cholesky": cholesky_solve,
    "block-inverse": block_inverse_solve,
}
