"""The feature filter: guides of a path tracer, with little noise and sharp edges.

Albedo, normal, emission and alpha of a few samples per pixel hold at an edge a noisy share of what
lies on either side. All of them share their edges, whose direction the gradients nearby tell far
better than a pixel tells its own share: so every feature is averaged along the edges, over the
pixels that the gradients say are alike (steering kernels: Takeda, Farsiu and Milanfar, "Kernel
Regression for Image Processing and Reconstruction", 2007).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jflnr.frame import Array
from jflnr.lazy import jax, jnp, lax
from jflnr.regression.strips import ROWS, fill

# Pixels on each side of a window of 7 x 7, and the standard deviation of its weights.
REACH, WIDTH = 3, 2.0
# How far features may differ by their gradients, one standard deviation, where they vary by about
# 1: the variance with one sample per pixel, which falls with their number, and with all of them.
# Blurred they may differ by so many times that.
VARIANCE, LEAST, NEAR = 0.085, 0.0025, 2.5
# Pixels of equal weight that are as good as none.
NOTHING = 2e-12
# Of a picture that does not say how many it is made of.
SAMPLES = 4
# How many pixels away a filtered one looks: over its window and that of `coverage`, and seven
# times at the next pixel, for blurs and gradients.
FARTHEST = 2 * REACH + 7


def average(
    steer: jax.Array, follow: jax.Array, usable: jax.Array, alike: jax.Array | float
) -> tuple[jax.Array, jax.Array]:
    """Planes averaged along the edges of others.

    steer: `(S, H, W)`, what tells the edges. follow: `(K, H, W)`. usable: `(H, W)`, which pixels
    count. alike: how far `steer` may differ, one standard deviation, `()` or `(H, W)`.
    Returns how many pixels of equal weight tell as much, `(H, W)`, and the averages, `(K, H, W)`; 0
    where no pixel counts.
    """
    margin = ((0, 0), (REACH, REACH), (REACH, REACH))
    # Outside nothing is usable.
    there = jnp.where(usable, jnp.concatenate([jnp.ones_like(follow[:1]), follow]), 0)
    near = blur(steer)
    padded = [jnp.pad(a, margin) for a in (near, there)]
    both = structure(near), jnp.full_like(there[:1], NEAR**-2)
    steepness = jnp.concatenate(both) / alike**2
    padded, steepness = lax.optimization_barrier((padded, steepness))

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        around = rows + 2 * REACH
        others, values = (lax.dynamic_slice_in_dim(a, first, around, axis=1) for a in padded)
        return _windows(others, values, lax.dynamic_slice_in_dim(steepness, first, rows, axis=1))

    sums = jnp.zeros((1 + len(there), *usable.shape), there.dtype)
    sums = fill(sums, 1, usable.shape[0], 1, ROWS, strip)
    squares, total = jnp.maximum(sums[:2], 1e-12)
    return total**2 / squares, sums[2:] / total


def _windows(near: jax.Array, there: jax.Array, steepness: jax.Array) -> jax.Array:
    """Sums of squared weights, of weights and of weighted planes over each window.

    near: what must be alike, of some rows with their margins. there: likewise, what is averaged,
    behind what is usable. steepness: `(4, h, W)`, of the rows, by steps and by what differs.
    Returns `(2 + K, h, W)`.
    """
    height, width = steepness.shape[1:]
    side = 2 * REACH + 1
    here = near[:, REACH : REACH + height, REACH : REACH + width]

    def add(tap: jax.Array, total: jax.Array) -> jax.Array:
        i, j = tap // side, tap % side
        other, values = (
            lax.dynamic_slice(a, (0, i, j), (len(a), height, width)) for a in (near, there)
        )
        y, x = i - REACH, j - REACH
        across = y * y * steepness[0] + 2 * y * x * steepness[1] + x * x * steepness[2]
        across += steepness[3] * jnp.sum((other - here) ** 2, axis=0)
        apart = across + (y * y + x * x) / WIDTH**2
        weighted = jnp.exp(-apart / 2) * values
        squared = jnp.exp(-apart) * values[:1]
        return total + jnp.concatenate([squared, weighted])

    empty = jnp.zeros((1 + len(there), height, width), there.dtype)
    return lax.fori_loop(0, side**2, add, empty)


def structure(image: jax.Array) -> jax.Array:
    """Mean products of the gradients, down by down, down by right and right by right, `(3, H, W)`.

    The form of a step is the square of what all planes of `image`, `(K, H, W)`, change over it.
    """
    down, right = (_slope(image, axis) for axis in (1, 2))
    products = ((down, down), (down, right), (right, right))
    tensor = jnp.stack([jnp.sum(a * b, axis=0) for a, b in products])
    for _ in range(3):
        tensor = blur(tensor)
    return tensor


def _slope(image: jax.Array, axis: int) -> jax.Array:
    before, _, after = _three(image, axis)
    # XLA is not to compute it anew for every pixel that reads it.
    return lax.optimization_barrier((after - before) / 2)


def filter_features(
    steering: Sequence[Array], following: Sequence[Array], samples: Array | float = SAMPLES
) -> tuple[jax.Array, ...]:
    """Features averaged along the edges that they share.

    steering: what tells the edges, `(H, W, C)` each, so scaled that it varies by about 1.
    following: what is averaged, `(H, W, C)` each, in any unit. A pixel with a value that is not
    finite in either is left out of the averages, and gets that of its neighbours, if one counts;
    else it stays as it is.
    samples: per pixel, that either is made of, or `(H, W, 1)`.
    Returns the features of `following`.
    """
    steer, follow = (
        jnp.moveaxis(jnp.concatenate([jnp.asarray(layer) for layer in layers], axis=-1), -1, 0)
        for layers in (steering, following)
    )
    usable = jnp.all(jnp.isfinite(steer), axis=0) & jnp.all(jnp.isfinite(follow), axis=0)
    alike: Any = alike_of(jnp.asarray(samples))
    number, averages = average(jnp.where(usable, steer, 0), follow, usable, alike)
    filtered = jnp.moveaxis(jnp.where(number > NOTHING, averages, follow), 0, -1)
    ends = np.cumsum([layer.shape[-1] for layer in following])[:-1].tolist()
    return tuple(jnp.split(filtered, ends, axis=-1))


def alike_of(samples: Array) -> Array:
    """How far features of so many samples per pixel may differ, `()` or `(H, W)`."""
    xp: Any = samples.__array_namespace__()
    alike = xp.sqrt(VARIANCE / xp.maximum(samples, 1) + LEAST)
    return xp.reshape(alike, alike.shape[:2])


def coverage(image: Array, least: Array | float) -> Array:
    """Light, or albedo that shows lamps, as the share of what is brightest nearby.

    At the edge of something far brighter than white, the share of the pixel that it covers is
    what is alike along the edge. image: `(H, W, C)`. least: brightness below which nothing counts
    as bright, `()`. Returns `(H, W, C)`, about 0 to 1.
    """
    peak = jnp.max(jnp.where(jnp.isfinite(image), image, 0), axis=-1)
    nearby: Any = combine(peak, REACH, jnp.maximum)
    return image / jnp.maximum(blur(blur(nearby[None]))[0], least)[..., None]


def combine(image: Array, reach: int, two: Callable[[Array, Array], Array]) -> Array:
    """The sum or the greatest of `2 reach + 1` pixels down and across, with zeros outside.

    image: `(H, W)`. two: that of two images.
    """
    xp: Any = image.__array_namespace__()
    for axis in (0, 1):
        padded = xp.pad(image, [(reach, reach) if a == axis else (0, 0) for a in (0, 1)])
        moved = [_rows(padded, axis, k, image.shape[axis]) for k in range(2 * reach + 1)]
        image = functools.reduce(two, moved)
    return image


def blur(image: jax.Array) -> jax.Array:
    """The mean over 3 x 3 pixels with the weights 1, 2, 1, `(K, H, W)`; borders are repeated."""
    for axis in (1, 2):
        before, here, after = _three(image, axis)
        image = lax.optimization_barrier((before + 2 * here + after) / 4)
    return image


def _three(image: jax.Array, axis: int) -> list[jax.Array]:
    """The pixels before, those here and those after, along an axis; borders are repeated."""
    margin = [(1, 1) if a == axis else (0, 0) for a in range(3)]
    padded = jnp.pad(image, margin, mode="edge")
    return [_rows(padded, axis, k, image.shape[axis]) for k in range(3)]


def _rows(image: Any, axis: int, first: int, count: int) -> Any:
    return image[(slice(None),) * axis + (slice(first, first + count),)]
