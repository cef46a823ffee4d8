"""Local models of every order at once: least squares whose regressors come in groups, nested.

Elimination without roots, `R = L D L^T`, takes the guides in one after the other. What each adds to
the fit is known as soon as it is taken in, whatever comes later: with z = L^-1 r, guide k explains
`z_k^2 / D_k` of the variance of the light. So one factorisation holds the models of all orders
1, [1, normal], [1, normal, depth], ..., and their criteria. Back substitution with z scaled group
by group is the average of these models (Hansen, Least squares model averaging, 2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jflnr.regression.elimination import STRIP, normal_equations
from jflnr.regression.level import brightness


class Orders(NamedTuple):
    """The averaged models, and how they came about.

    coefficients: `(Q + 1, C, h, w)`. shares: `(G, h, w)`, how much of each group is in them.
    explained: `(G, h, w)`, what of the variance of the brightness each group explains.
    """

    coefficients: jax.Array
    shares: jax.Array
    explained: jax.Array


def fit_orders(
    moments: jax.Array,
    shift: jax.Array,
    regular: tuple[jax.Array, jax.Array],
    noise: jax.Array,
    groups: Sequence[int],
    channels: int,
) -> Orders:
    """Models of all nested orders of each block, averaged by how much of each group is signal.

    A group of d guides explains d `noise` of the variance even where there is nothing to explain
    (Mallows 1973). The share of the group that makes the expected error least is the Wiener filter
    `max(explained - d noise, 0) / explained`, between the model without it and the one with it.

    moments: `(K, h, w)` under the windows. shift: `(Q,)`. regular: eps and eps' of Eq. 18, `(h, w)`
    each. noise: `(h, w)`, what one regressor explains of noise: the variance of the window's mean
    brightness. groups: numbers of guides that enter together, in order; their sum is Q.
    """
    width = moments.shape[2]
    rows = min(max(STRIP // width, 1), moments.shape[1])
    planes = jnp.concatenate([moments, jnp.stack([*regular, noise])])
    planes = jnp.pad(planes, ((0, 0), (0, -planes.shape[1] % rows), (0, 0)))
    strips = jnp.moveaxis(planes.reshape(planes.shape[0], -1, rows, width), 1, 0)
    result = lax.map(lambda strip: _strip(strip, shift, tuple(groups), channels), strips)

    def whole(part: jax.Array) -> jax.Array:
        part = jnp.moveaxis(part, 0, -3)
        return part.reshape(*part.shape[:-3], planes.shape[1], width)[..., : moments.shape[1], :]

    return jax.tree.map(whole, result)


def _strip(planes: jax.Array, shift: jax.Array, groups: tuple[int, ...], channels: int) -> Orders:
    moments, eps, eps_prime, noise = planes[:-3], planes[-3], planes[-2], planes[-1]
    system = normal_equations(moments, shift, eps, eps_prime, channels)
    if not groups:
        return Orders(system.mean_y[None], system.scale, system.scale)
    upper = eliminate(jnp.concatenate([system.correlation, system.right], axis=1))
    weights = brightness(channels, moments.dtype)
    light = jnp.einsum("qchw,c->qhw", upper.right, weights)
    added = light**2 * upper.inverse
    ends = np.cumsum(groups)
    explained = jnp.stack(
        [jnp.sum(added[e - d : e], axis=0) for d, e in zip(groups, ends, strict=True)]
    )
    shares = signal_share(explained, jnp.array(groups)[:, None, None] * noise)
    each = jnp.repeat(shares, np.array(groups), axis=0)
    slopes = substitute(upper, each) * system.scale[:, None]
    value = system.mean_y - jnp.sum(system.mean_x[:, None] * slopes, axis=0)
    return Orders(jnp.concatenate([value[None], slopes]), shares, explained)


def signal_share(power: jax.Array, noise: jax.Array) -> jax.Array:
    """`max(power - noise, 0) / power`, and 0 where there is neither."""
    return jnp.maximum(power - noise, 0) / jnp.where(power > 0, power, 1)


class Upper(NamedTuple):
    """An eliminated system: 1 / D `(Q, h, w)`, D L^T `(Q, Q, h, w)` and z `(Q, C, h, w)`."""

    inverse: jax.Array
    rows: jax.Array
    right: jax.Array


def eliminate(system: jax.Array) -> Upper:
    """`R = L D L^T` and `z = L^-1 r` of `[R, r]`, `(Q, Q + C, h, w)`.

    A pivot no larger than the rounding error belongs to a guide that those before it explain
    already: it explains nothing and gets the slope 0.
    """
    count = system.shape[0]
    number = jnp.arange(count)[:, None, None]

    def step(k: jax.Array, state: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        system, inverses = state
        row, column = system[k], system[:, k]
        clear = row[k] > 8 * jnp.finfo(row.dtype).eps
        inverse = jnp.where(clear, 1 / jnp.where(clear, row[k], 1), 0)
        factor = jnp.where(number > k, column * inverse, 0)
        return system - factor[:, None] * row, inverses.at[k].set(inverse)

    state = system, jnp.zeros_like(system[:, 0])
    system, inverse = lax.fori_loop(0, count, step, state)
    return Upper(inverse, system[:, :count], system[:, count:])


def substitute(upper: Upper, shares: jax.Array) -> jax.Array:
    """Slopes `(Q, C, h, w)` of the average of the nested models. shares: `(Q, h, w)`."""
    count = upper.inverse.shape[0]
    later = jnp.arange(count)[:, None, None]

    def step(i: jax.Array, solution: jax.Array) -> jax.Array:
        k = count - 1 - i
        row = jnp.where(later > k, upper.rows[k], 0)
        known = jnp.sum(row[:, None] * solution, axis=0)
        return solution.at[k].set((shares[k] * upper.right[k] - known) * upper.inverse[k])

    return lax.fori_loop(0, count, step, jnp.zeros_like(upper.right))
