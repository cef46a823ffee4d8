"""The edge-aware window over blocks: two one-dimensional passes (replaces kernel 2 of section 3.2).

The window of block i weighs block j by `exp(-d^2 / (2 sigma^2)) exp(-|f_i - f_j|^2 / 2)`, with d
their distance in blocks and f what should be alike inside one window. The second factor keeps it
from reaching across walls. A pass along rows is followed by one along columns, each with the
weights between blocks of one line.
"""

from __future__ import annotations

import functools
import operator
from typing import NamedTuple

import numpy as np

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.moments import index_xx, index_xy

# Blocks on each side that the window extends over: two and a half of its standard deviations.
REACH = 5


class Window(NamedTuple):
    """Weights of the `2 REACH + 1` blocks on a block's line, `(taps, h, w)` each."""

    rows: jax.Array
    columns: jax.Array

    def squared(self) -> Window:
        """What the window does to variances."""
        return Window(self.rows**2, self.columns**2)


def window_over(features: jax.Array, sigma: jax.Array | float) -> Window:
    """The weights between blocks.

    features: `(F, h, w)`, scaled so that a distance of 1 is one standard deviation; with F = 0
    this is the plain Gaussian. sigma: standard deviation in blocks.
    """
    return Window(_line_weights(features, sigma, 2), _line_weights(features, sigma, 1))


def _line_weights(features: jax.Array, sigma: jax.Array | float, axis: int) -> jax.Array:
    size, padded = features.shape[axis], _padded(features, axis)

    def from_block(k: jax.Array) -> jax.Array:
        other = lax.dynamic_slice_in_dim(padded, k, size, axis)
        return jnp.sum((other - features) ** 2, axis=0)

    # A loop, which compiles in a fraction of the time that eleven sums take.
    distance = lax.map(from_block, jnp.arange(2 * REACH + 1))
    along = _offsets(features.dtype) / jnp.maximum(sigma, 1e-2)
    return lax.optimization_barrier(jnp.exp(-(distance + along**2) / 2))


def gather(planes: jax.Array, window: Window) -> jax.Array:
    """Weighted sum of every plane over the window; zeros outside. `(K, h, w)` to `(K, h, w)`."""
    return _gather(_gather(planes, window.rows, 2), window.columns, 1)


def gather_moments(
    moments: jax.Array,
    window: Window,
    unit: jax.Array | float,
    guides: int,
    channels: int,
    ridge: jax.Array | float = 0,
) -> jax.Array:
    """Moments over the window, with the position in it as two further guides.

    The positions x and y are those of the block centres, relative to the window's centre, so their
    moments come from the other planes and need no pass over pixels: a product with x is a pass
    along rows whose weights are multiplied by x.

    moments: `(K, h, w)` of Q `guides`. unit: blocks per unit of x and y. ridge: is added to the
    mean squares of x and of y.
    Returns the planes of Q + 2 guides, in the order of `moments.py`.
    """
    xx = index_xy(0, 0, guides, channels)
    first = np.array(
        [index_xx(i, 0) for i in range(guides + 1)]
        + [index_xy(0, c, guides, channels) for c in range(channels)]
    )
    offset = _offsets(moments.dtype) / unit
    rows, columns = window
    m = _gather(moments, rows, 2)
    m_x = _gather(moments[first], rows * offset, 2)
    m_xx = _gather(moments[:1], rows * offset**2, 2)
    m_yy = _gather(m[:1], columns * offset**2, 1)
    both = _gather(jnp.concatenate([m[first], m_x[:1]]), columns * offset, 1)
    m_y, m_xy = both[:-1], both[-1:]
    both = _gather(jnp.concatenate([m, m_x, m_xx]), columns, 1)
    m, m_x, m_xx = jnp.split(both, [len(m), len(m) + len(m_x)])
    q, ridge = guides + 1, ridge * m[:1]
    matrix = [m[:xx], m_x[:q], m_xx + ridge, m_y[:q], m_xy, m_yy + ridge]
    return jnp.concatenate([*matrix, m[xx:], m_x[q:], m_y[q:]])


def _gather(planes: jax.Array, taps: jax.Array, axis: int) -> jax.Array:
    """Sums of the planes times the taps along an axis.

    The derivative goes tap by tap in a loop: that of the sum as written would be programs for each
    tap, which compile for half a minute in all.
    """
    size = planes.shape[axis]

    def at_once(planes: jax.Array, taps: jax.Array) -> jax.Array:
        padded = _padded(planes, axis)
        moved = (lax.slice_in_dim(padded, k, k + size, axis=axis) for k in range(len(taps)))
        products = (taps[k : k + 1] * one for k, one in enumerate(moved))
        # Without the barrier the compiler repeats the first pass for every tap of the second.
        return lax.optimization_barrier(functools.reduce(operator.add, products))

    def derivative(given: tuple, change: tuple) -> tuple[jax.Array, jax.Array]:
        (planes, taps), (d_planes, d_taps) = given, change
        padded, d_padded = _padded(planes, axis), _padded(d_planes, axis)

        def add(k: jax.Array, total: jax.Array) -> jax.Array:
            here, d_here = (lax.dynamic_slice_in_dim(p, k, size, axis) for p in (padded, d_padded))
            tap, d_tap = (lax.dynamic_slice_in_dim(t, k, 1) for t in (taps, d_taps))
            return total + tap * d_here + d_tap * here

        none = jnp.zeros(planes.shape, jnp.result_type(planes, taps))
        return at_once(planes, taps), lax.fori_loop(0, len(taps), add, none)

    gather = jax.custom_jvp(at_once)
    gather.defjvp(derivative)
    return gather(planes, taps)


def _padded(planes: jax.Array, axis: int) -> jax.Array:
    """With REACH blocks of zeros on both sides: once, instead of a test for the border per tap."""
    margins = [(REACH, REACH) if a == axis else (0, 0) for a in range(planes.ndim)]
    return lax.optimization_barrier(jnp.pad(planes, margins))


def _offsets(dtype: jnp.dtype) -> jax.Array:
    """Blocks from the centre to each tap, `(taps, 1, 1)`."""
    return jnp.arange(-REACH, REACH + 1, dtype=dtype)[:, None, None]
