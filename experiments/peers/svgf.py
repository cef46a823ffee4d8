"""Spatiotemporal Variance-Guided Filtering (Schied et al. 2017), of one frame or of a sequence.

Over a sequence light and the moments of its luminance are averaged (section 4.1); their variance
guides five a-trous levels (section 4.3), the first of which is what the next frame starts from.
Where a pixel has been seen in fewer than four frames, and in a single frame everywhere, the
variance is estimated from a 7 x 7 window (section 4.2). The paper's last step, TAA, is left out: it
works on the picture, not on the light.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from experiments.peers.atrous import SPLINE
from experiments.peers.windows import luminance, over_offsets, square
from jflnr.frame import Array, Frame
from jflnr.temporal import Average, Surface, accumulate, find_taps, reproject
from jflnr.temporal.accumulate import nothing

PAPER: dict[str, Any] = {"levels": 5, "sigma_l": 4.0, "sigma_n": 128.0, "sigma_z": 1.0}
TUNED: dict[str, Any] = {"levels": 5, "sigma_l": 64.0, "sigma_n": 4.0, "sigma_z": 16.0}
# With a history the light is less noisy, and depth tells more.
TUNED_OVER_TIME: dict[str, Any] = TUNED | {"sigma_l": 1e3, "sigma_z": 4.0}

GAUSS = np.outer(*[np.array([1, 2, 1], np.float32) / 4] * 2).ravel()


# Least share of a new frame in light and moments, and frames from which moments tell the variance.
SHARE, ENOUGH = 0.2, 4


class State(NamedTuple):
    """What one frame leaves to the next.

    light: after the first level of filtering. moments: of luminance, `(H, W, 2)`.
    """

    surface: Surface
    light: Average
    moments: Average


def start(frame: Frame) -> State:
    """Before the first frame."""
    height, width = frame.depth.shape[:2]
    surface = jax.tree.map(jnp.zeros_like, Surface.of(frame))
    return State(surface, nothing(height, width, 3), nothing(height, width, 2))


def step(
    state: State,
    frame: Frame,
    *,
    levels: int = 5,
    sigma_l: float = 4.0,
    sigma_n: float = 128.0,
    sigma_z: float = 1.0,
) -> tuple[State, Array]:
    """The next frame of a sequence, which has `motion`; parameters as of `denoise`.

    Returns the state for the next frame, and the demodulated light, `(H, W, 3)`.
    Raises `ValueError` for a frame without motion.
    """
    if frame.motion is None:
        raise ValueError("SVGF over time needs frames with a layer motion")
    return _step(state, frame, frame.motion, levels, (sigma_l, sigma_n, sigma_z))


@functools.partial(jax.jit, static_argnames="levels")
def _step(
    state: State, frame: Frame, motion: Array, levels: int, sigmas: tuple[float, float, float]
) -> tuple[State, jax.Array]:
    taps = find_taps(motion, Surface.of(frame), state.surface)
    bright = luminance(jnp.asarray(frame.indirect))
    light = accumulate(reproject(state.light, taps), frame.indirect, SHARE)
    moments = accumulate(
        reproject(state.moments, taps), jnp.concatenate([bright, bright**2], axis=-1), SHARE
    )
    first, second = moments.mean[..., :1], moments.mean[..., 1:]
    guides = _guides(frame)
    variance = jnp.where(
        moments.samples < ENOUGH - 0.5,
        _variance(light.mean, *guides, *sigmas[1:]),
        jnp.maximum(second - first**2, 0),
    )
    passes = _passes(light.mean, variance, guides, levels, sigmas)
    kept = light._replace(mean=passes[0])
    return State(Surface.of(frame), kept, moments), passes[-1]


def denoise(frame: Frame, *, levels: int, sigma_l: float, sigma_n: float, sigma_z: float) -> Array:
    """Spatial SVGF of the demodulated light, `(H, W, 3)`; the widths are those of Eq. 3 to 5."""
    return _denoise(frame, levels, (sigma_l, sigma_n, sigma_z))


@functools.partial(jax.jit, static_argnames="levels")
def _denoise(frame: Frame, levels: int, sigmas: tuple[float, float, float]) -> jax.Array:
    light, guides = jnp.asarray(frame.indirect), _guides(frame)
    variance = _variance(light, *guides, *sigmas[1:])
    return _passes(light, variance, guides, levels, sigmas)[-1]


def _guides(frame: Frame) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Normal, depth and the slope of the depth."""
    depth = jnp.asarray(frame.depth)
    return jnp.asarray(frame.normal), depth, _slope(depth)


def _passes(
    light: jax.Array,
    variance: jax.Array,
    guides: tuple[jax.Array, jax.Array, jax.Array],
    levels: int,
    sigmas: tuple[float, float, float],
) -> list[jax.Array]:
    """The light after each a-trous level."""
    found = []
    for level in range(levels):
        light, variance = _pass(light, variance, *guides, sigmas, 2**level)
        found.append(light)
    return found


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
