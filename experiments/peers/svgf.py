"""The spatial part of Spatiotemporal Variance-Guided Filtering (Schied et al. 2017), one frame.

Without a history the variance of luminance is estimated from a 7 x 7 window (section 4.2), as the
paper does for pixels seen in fewer than four frames; five a-trous levels follow (section 4.3).
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments.peers.atrous import SPLINE
from experiments.peers.windows import luminance, over_offsets, square
from jflnr.frame import Array, Frame

PAPER: dict[str, Any] = {"levels": 5, "sigma_l": 4.0, "sigma_n": 128.0, "sigma_z": 1.0}
TUNED: dict[str, Any] = {"levels": 5, "sigma_l": 1e3, "sigma_n": 4.0, "sigma_z": 4.0}

GAUSS = np.outer(*[np.array([1, 2, 1], np.float32) / 4] * 2).ravel()


def denoise(frame: Frame, *, levels: int, sigma_l: float, sigma_n: float, sigma_z: float) -> Array:
    """Spatial SVGF of the demodulated light, `(H, W, 3)`; the widths are those of Eq. 3 to 5."""
    return _denoise(frame, levels, sigma_l, sigma_n, sigma_z)


@functools.partial(jax.jit, static_argnames="levels")
def _denoise(
    frame: Frame, levels: int, sigma_l: float, sigma_n: float, sigma_z: float
) -> jax.Array:
    light, normal, depth = (jnp.asarray(a) for a in (frame.indirect, frame.normal, frame.depth))
    slope = _slope(depth)
    variance = _variance(light, normal, depth, slope, sigma_n, sigma_z)
    for level in range(levels):
        light, variance = _pass(
            light, variance, normal, depth, slope, (sigma_l, sigma_n, sigma_z), 2**level
        )
    return light


def _slope(depth: jax.Array) -> jax.Array:
    """Screen-space derivatives of depth `(H, W, 2)`, the smaller one-sided: edges do not count."""

    def smaller(axis: int) -> jax.Array:
        step = jnp.diff(depth, axis=axis)
        end = jnp.zeros_like(jax.lax.slice_in_dim(depth, 0, 1, axis=axis))
        after = jnp.concatenate([step, end], axis)
        before = jnp.concatenate([end, step], axis)
        return jnp.where(jnp.abs(after) < jnp.abs(before), after, before)

    return jnp.concatenate([smaller(0), smaller(1)], axis=-1)


def _geometry(
    here: tuple[jax.Array, jax.Array, jax.Array],
    there: tuple[jax.Array, jax.Array],
    offset: jax.Array,
    sigma_n: float,
    sigma_z: float,
) -> jax.Array:
    """Product of the depth and normal weights, Eq. 3 and 4. here: normal, depth, slope."""
    (normal, depth, slope), (normal_q, depth_q) = here, there
    along = jnp.abs(jnp.sum(slope * offset, axis=-1, keepdims=True))
    # A thousandth of the depth instead of the paper's constant, which has the scene's unit.
    w_z = jnp.exp(-jnp.abs(depth - depth_q) / (sigma_z * along + 1e-3 * depth + 1e-9))
    cosine = jnp.sum(normal * normal_q, axis=-1, keepdims=True)
    return w_z * jnp.maximum(cosine, 0) ** sigma_n * (depth_q > 0)


def _variance(
    light: jax.Array,
    normal: jax.Array,
    depth: jax.Array,
    slope: jax.Array,
    sigma_n: float,
    sigma_z: float,
) -> jax.Array:
    """Variance of luminance over the 7 x 7 pixels like this one, `(H, W, 1)`."""
    offsets = square(3)
    table = jnp.asarray(offsets, light.dtype)

    def tap(sums: jax.Array, there: tuple, k: jax.Array) -> jax.Array:
        l_q, normal_q, depth_q = there
        place = (normal, depth, slope)
        weight = _geometry(place, (normal_q, depth_q), table[k], sigma_n, sigma_z)
        return sums + weight * jnp.concatenate([jnp.ones_like(l_q), l_q, l_q**2], axis=-1)

    images = (luminance(light), normal, depth)
    sums = over_offsets(tap, jnp.zeros_like(light), images, offsets)
    weight = jnp.maximum(sums[..., :1], 1e-6)
    return jnp.maximum(sums[..., 2:] / weight - (sums[..., 1:2] / weight) ** 2, 0)


def _pass(
    light: jax.Array,
    variance: jax.Array,
    normal: jax.Array,
    depth: jax.Array,
    slope: jax.Array,
    sigmas: tuple[float, float, float],
    step: int,
) -> tuple[jax.Array, jax.Array]:
    """One a-trous level of light and variance, Eq. 1, 2 and 5."""
    sigma_l, sigma_n, sigma_z = sigmas
    brightness = luminance(light)
    width = sigma_l * jnp.sqrt(_smooth(variance)) + 1e-6 * jnp.mean(brightness) + 1e-9
    offsets = square(2, step)
    table, spline = jnp.asarray(offsets, light.dtype), jnp.asarray(SPLINE)

    def tap(sums: tuple, there: tuple, k: jax.Array) -> tuple:
        light_q, variance_q, normal_q, depth_q, brightness_q = there
        place = (normal, depth, slope)
        weight = spline[k] * _geometry(place, (normal_q, depth_q), table[k], sigma_n, sigma_z)
        weight = weight * jnp.exp(-jnp.abs(brightness - brightness_q) / width)
        return sums[0] + weight * light_q, sums[1] + weight**2 * variance_q, sums[2] + weight

    zero = jnp.zeros_like(brightness)
    images = (light, variance, normal, depth, brightness)
    total, spread, weight = over_offsets(tap, (jnp.zeros_like(light), zero, zero), images, offsets)
    alone = weight < 1e-6  # nothing to average, as in the sky
    weight = jnp.where(alone, 1, weight)
    return (
        jnp.where(alone, light, total / weight),
        jnp.where(alone, variance, spread / weight**2),
    )


def _smooth(variance: jax.Array) -> jax.Array:
    """3 x 3 Gaussian, of what is inside the frame."""
    taps = jnp.asarray(GAUSS)

    def tap(sums: tuple, there: tuple, k: jax.Array) -> tuple:
        value, exists = there
        return sums[0] + taps[k] * value, sums[1] + taps[k] * exists

    zero = jnp.zeros_like(variance)
    total, weight = over_offsets(tap, (zero, zero), (variance, zero + 1), square(1))
    return total / weight
