"""The normalised, regularised least squares of the Appendix (section 3.2, kernel 3)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.division import divide
from jflnr.regression.elimination import SOLVERS, Solver, by_its_equation, eliminate
from jflnr.regression.moments import index_xx, index_xy
from jflnr.regression.strips import cut, fill

# Roundings that a variance, a difference of two sums, may be off by: of plain windows, and of
# edge-aware ones, which may lie far from the shift and hold few blocks.
ROUNDING, ROUNDING_OF_STRIPS = 8, 64
# Blocks of a grid that are worked on at a time, about.
TOGETHER = 4096


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

    def models(self, solution: jax.Array) -> jax.Array:
        """Eq. 23 as an affine function of X - shift: `(Q, C, h, w)` to `(Q + 1, C, h, w)`."""
        slopes = solution * self.scale[:, None]
        value = self.mean_y - jnp.sum(self.mean_x[:, None] * slopes, axis=0)
        return jnp.concatenate([value[None], slopes])


def normal_equations(
    moments: jax.Array,
    shift: jax.Array,
    eps: jax.Array,
    eps_prime: jax.Array,
    channels: int,
    rounding: int,
) -> NormalEquations:
    """The equations of each block's model (Appendix, Eq. 13-22), from moments of X - shift.

    Eq. 18 reads, with mu the mean of X and W the covariance,
    `W + eps (mu mu^T + diag(mu^2)) + eps' I`; W does not depend on the shift, so it is taken from
    the shifted moments, where it loses no digits, and mu is shifted back.

    moments: `(K, h, w)`. shift: `(Q,)`. eps, eps_prime: multiplicative and additive regularisation,
    numbers or `(h, w)`. channels: the number C of target channels. rounding: roundings that may add
    up in a moment; no more of a variance is known than they leave.
    """
    count = shift.size
    means = moments * divide(1, moments[0], 1e-12)

    # Eq. 13 and 15, about the shift.
    first = np.array([index_xx(i + 1, 0) for i in range(count)], int)
    pairs = np.array([index_xx(i + 1, j + 1) for i, j in np.ndindex(count, count)], int)
    mean_x = means[first]
    mean_y, cross = jnp.split(means[index_xy(0, 0, count, channels) :], [channels])
    covariance = means[pairs.reshape(count, count)] - mean_x[:, None] * mean_x

    # Eq. 18; rounding can leave a flat guide's variance just below zero.
    diagonal = jnp.eye(count, dtype=bool)[:, :, None, None]
    covariance = jnp.where(diagonal, jnp.maximum(covariance, 0), covariance)
    unknown = rounding * jnp.finfo(means.dtype).eps * (covariance + mean_x[:, None] * mean_x)
    mu = mean_x + shift[:, None, None].astype(means.dtype)
    outer = eps * mu[:, None] * mu
    regular = covariance + outer + jnp.where(diagonal, outer + eps_prime + unknown, 0)

    # Eq. 19 to 22, with a unit diagonal before eps' is added.
    # A slice: as a stack of Q planes it compiles for a second.
    scale = lax.rsqrt(regular.reshape(-1, *mean_x.shape[1:])[:: count + 1])
    correlation = jnp.where(diagonal, 1 + eps_prime, regular * scale[:, None] * scale)
    cross = cross.reshape(count, channels, *means.shape[1:])
    right = (cross - mean_x[:, None] * mean_y) * scale[:, None]
    return NormalEquations(correlation, right, scale, mean_x, mean_y)


def solve(
    moments: jax.Array, shift: jax.Array, method: Any, channels: int, solver: Solver = "cholesky"
) -> jax.Array:
    """Coefficients of the local affine models, one per block (Appendix, Eq. 12-23).

    A window without a single usable pixel, or whose moments overflow, gets the model 0.

    moments: `(K, h, w)`, blurred. shift: `(Q,)`. channels: the number C of target channels.
    Returns `(Q + 1, C, h, w)`: the value of Y at X = shift, then the slope of each guide.
    """
    eps, eps_prime = (number.astype(moments.dtype) for number in regularisation(method))
    moments = jnp.where(jnp.all(jnp.isfinite(moments), axis=0), moments, 0)
    system = normal_equations(moments, shift, eps, eps_prime, channels, ROUNDING)
    return system.models(by_its_equation(SOLVERS[solver], system.correlation, system.right))


def regularisation(method: Any) -> tuple[Any, Any]:
    """eps and eps', cut where they change nothing more and numbers after them would overflow."""
    plain = isinstance(method.eps, float) and isinstance(method.eps_prime, float)
    xp: Any = np if plain else jnp
    return xp.minimum(method.eps, 1e4), xp.clip(method.eps_prime, 1e-24, 1e30)


def solve_strips(
    moments: jax.Array, shift: jax.Array, eps: jax.Array, eps_prime: jax.Array, channels: int
) -> jax.Array:
    """`solve` by elimination, with regularisation `(h, w)` that differs from block to block.

    A few rows of blocks at a time stay in the cache, and elimination is one short loop, which
    compiles in a fraction of the time that a factorisation written out takes.
    """

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        given = cut((moments, eps, eps_prime), first, rows, axis=-2)
        planes, own, own_prime = lax.optimization_barrier(given)
        system = normal_equations(planes, shift, own, own_prime, channels, ROUNDING_OF_STRIPS)
        return system.models(by_its_equation(eliminate, system.correlation, system.right))

    height, width = moments.shape[1:]
    models = jnp.zeros((shift.size + 1, channels, height, width), moments.dtype)
    return fill(models, 2, height, 1, max(TOGETHER // width, 1), strip)
