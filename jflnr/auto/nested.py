"""Local models of every order at once: least squares whose regressors come in groups, nested.

Elimination without roots, `R = L D L^T`, takes the guides in one after the other. What each adds to
the fit is known as soon as it is taken in, whatever comes later: with z = L^-1 r, guide k explains
`z_k^2 / D_k` of the variance of the light. So one factorisation holds the models of all orders
1, [1, normal], [1, normal, depth], ..., and their criteria. Back substitution with z scaled group
by group is the average of these models (Hansen, Least squares model averaging, 2007).
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.regression.division import divide
from jflnr.regression.elimination import factor, substitute
from jflnr.regression.level import brightness
from jflnr.regression.solve import ROUNDING_OF_STRIPS, normal_equations
from jflnr.regression.strips import map_rows


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
    fit = functools.partial(_fit, shift=shift, groups=tuple(groups), channels=channels)
    return map_rows(fit, (moments, *regular, noise))


def _fit(
    planes: tuple[jax.Array, ...], *, shift: jax.Array, groups: tuple[int, ...], channels: int
) -> Orders:
    moments, eps, eps_prime, noise = planes
    system = normal_equations(moments, shift, eps, eps_prime, channels, ROUNDING_OF_STRIPS)
    if not groups:
        return Orders(system.mean_y[None], system.scale, system.scale)
    factored = factor(system.correlation, system.right)
    light = jnp.einsum("qchw,c->qhw", factored.right, brightness(channels, moments.dtype))
    added = light**2 * factored.inverse
    ends = np.cumsum(groups)
    explained = jnp.stack(
        [jnp.sum(added[e - d : e], axis=0) for d, e in zip(groups, ends, strict=True)]
    )
    shares = signal_share(explained, jnp.array(groups)[:, None, None] * noise)
    each = jnp.repeat(shares, np.array(groups), axis=0)
    return Orders(system.models(substitute(factored, each)), shares, explained)


def signal_share(power: jax.Array, noise: jax.Array) -> jax.Array:
    """`max(power - noise, 0) / power`, and 0 where there is neither."""
    return divide(jnp.maximum(power - noise, 0), power)
