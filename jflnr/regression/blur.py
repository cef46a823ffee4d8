"""The Gaussian window: a separable convolution of the moments (section 3.2, kernel 2)."""

from __future__ import annotations

import math

from jflnr.lazy import jax, jnp, lax


def gaussian_taps(
    sigma: jax.Array | float, reach: int, dtype: jnp.dtype, end: jax.Array | float = math.inf
) -> jax.Array:
    """Gaussian weights at -reach..reach with sum 1, differentiable in `sigma` at any value >= 0.

    sigma: standard deviation, in steps of the grid. end: they are 0 beyond it; it may be traced.
    Returns `(2 reach + 1,)`.
    """
    offsets = jnp.arange(-reach, reach + 1, dtype=dtype)
    # The bound keeps a width of zero the identity instead of 0/0.
    variance = jnp.maximum(jnp.asarray(sigma, dtype), 1e-2) ** 2
    taps = jnp.where(jnp.abs(offsets) <= end, jnp.exp(-0.5 * offsets**2 / variance), 0)
    return taps / jnp.sum(taps)


def blur(moments: jax.Array, sigma: jax.Array | float, reach: int | jax.Array) -> jax.Array:
    """Convolve every plane with a Gaussian, taking zeros outside the frame.

    Zeros are right there, because the plane of ones is blurred along with the rest and the
    regression divides by it.

    moments: `(K, h, w)`. sigma: standard deviation in blocks, traced. reach: blocks on each side
    that the window extends over; if it is traced, each pass is the product with a matrix, as any
    number of shifts would be too many to compile. Returns `(K, h, w)`.
    """
    if not isinstance(reach, int):
        h, w = moments.shape[1:]
        taps = gaussian_taps(sigma, max(h, w), moments.dtype, reach)
        down, across = (taps[max(h, w) + jnp.arange(n) - jnp.arange(n)[:, None]] for n in (h, w))
        return jnp.einsum("yv,kvu,xu->kyx", down, moments, across, precision="highest")
    taps = gaussian_taps(sigma, reach, moments.dtype)
    # Without the barrier the compiler repeats the first pass for every tap of the second.
    columns = lax.optimization_barrier(_convolve(moments, taps, axis=1))
    return _convolve(columns, taps, axis=2)


def _convolve(planes: jax.Array, taps: jax.Array, axis: int) -> jax.Array:
    """Weighted sum of shifted copies: on a CPU 20 times faster than the general convolution."""
    size = planes.shape[axis]
    # What lies farther than the frame is wide is zero everywhere.
    reach = min(taps.size // 2, size - 1)
    taps = lax.slice_in_dim(taps, taps.size // 2 - reach, taps.size // 2 + reach + 1)
    margins = [(reach, reach) if a == axis else (0, 0) for a in range(planes.ndim)]
    padded = jnp.pad(planes, margins)
    shifted = (lax.slice_in_dim(padded, k, k + size, axis=axis) for k in range(taps.size))
    return sum((taps[k] * s for k, s in enumerate(shifted)), jnp.zeros_like(planes))
