"""The edge-aware window over blocks: two one-dimensional passes (replaces kernel 2 of section 3.2).

The window of block i weighs block j by `exp(-d^2 / (2 sigma^2)) exp(-|f_i - f_j|^2 / 2)`, with d
their distance in blocks and f what should be alike inside one window. The second factor keeps it
from reaching across walls. A pass along rows is followed by one along columns, each with the
weights between blocks of one line.
"""

from __future__ import annotations

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
    moved = _moved(features, axis)
    distance = jnp.stack([jnp.sum((other - features) ** 2, axis=0) for other in moved])
    along = _offsets(features.dtype) / jnp.maximum(sigma, 1e-2)
    return lax.optimization_barrier(jnp.exp(-(distance + along**2) / 2))


def gather(planes: jax.Array, window: Window) -> jax.Array:
    """Weighted sum of every plane over the window; zeros outside. `(K, h, w)` to `(K, h, w)`."""
    return _gather(_gather(planes, window.rows, 2), window.columns, 1)


def gather_moments(
    moments: jax.Array, window: Window, unit: jax.Array | float, guides: int, channels: int
) -> jax.Array:
    """Moments over the window, with the position in it as two further guides.

    The positions x and y are those of the block centres, relative to the window's centre, so their
    moments come from the other planes and need no pass over pixels: a product with x is a pass
    along rows whose weights are multiplied by x.

    moments: `(K, h, w)` of Q `guides`. unit: blocks per unit of x and y.
    Returns the planes of Q + 2 guides, in the order of `moments.py`.
    """
    xx = (guides + 1) * (guides + 2) // 2
    first = np.array(
        [index_xx(i, 0) for i in range(guides + 1)]
        + [index_xy(0, c, guides, channels) for c in range(channels)]
    )
    offset = _offsets(moments.dtype) / unit
    rows, columns = window
    m = _gather(moments, rows, 2)
    m_x = _gather(moments[first], rows * offset, 2)
    m_xx = _gather(moments[:1], rows * offset**2, 2)
    m_y = _gather(m[first], columns * offset, 1)
    m_xy = _gather(m_x[:1], columns * offset, 1)
    m_yy = _gather(m[:1], columns * offset**2, 1)
    m, m_x, m_xx = (_gather(planes, columns, 1) for planes in (m, m_x, m_xx))
    q = guides + 1
    matrix = [m[:xx], m_x[:q], m_xx, m_y[:q], m_xy, m_yy]
    return jnp.concatenate([*matrix, m[xx:], m_x[q:], m_y[q:]])


def _gather(planes: jax.Array, taps: jax.Array, axis: int) -> jax.Array:
    moved = _moved(planes, axis)
    total = taps[0] * moved[0]
    for tap, one in zip(taps[1:], moved[1:], strict=True):
        total += tap * one
    # Without the barrier the compiler repeats the first pass for every tap of the second.
    return lax.optimization_barrier(total)


def _moved(planes: jax.Array, axis: int) -> list[jax.Array]:
    """The planes moved by -REACH to REACH blocks, zeros from outside."""
    size = planes.shape[axis]
    margins = [(REACH, REACH) if a == axis else (0, 0) for a in range(planes.ndim)]
    # Padded once, instead of a test for the border at every tap.
    padded = lax.optimization_barrier(jnp.pad(planes, margins))
    return [lax.slice_in_dim(padded, k, k + size, axis=axis) for k in range(2 * REACH + 1)]


def _offsets(dtype: jnp.dtype) -> jax.Array:
    """Blocks from the centre to each tap, `(taps, 1, 1)`."""
    return jnp.arange(-REACH, REACH + 1, dtype=dtype)[:, None, None]
