"""The feature filter: guides of a path tracer, with little noise and sharp edges.

Albedo, normal, emission and alpha of a few samples per pixel hold at an edge a noisy share of what
lies on either side. All of them share their edges, whose direction the gradients nearby tell far
better than a pixel tells its own share: so every feature is averaged along the edges, over the
pixels that the gradients say are alike (steering kernels: Takeda, Farsiu and Milanfar, "Kernel
Regression for Image Processing and Reconstruction", 2007).
"""

from __future__ import annotations

from collections.abc import Sequence

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.moments import planes
from jflnr.regression.strips import ROWS, fill

# Pixels on each side of a window of 7 x 7, and the standard deviation of its weights.
REACH, WIDTH = 3, 2.0
# How far features may differ, one standard deviation, where they vary by about 1: by their
# gradients, and blurred, where two that 4 samples tell differ by 0.14 with noise alone.
ALIKE, NEAR = 0.15, 0.3
# How many pixels away a filtered one looks: over its window and that of `coverage`, and seven
# times at the next pixel, for blurs and gradients.
FARTHEST = 2 * REACH + 7


def filter_features(
    steering: Sequence[jax.Array], following: Sequence[jax.Array]
) -> tuple[jax.Array, ...]:
    """Features averaged along the edges that they share.

    steering: what tells the edges, `(H, W, C)` each, so scaled that it varies by about 1.
    following: what is averaged, `(H, W, C)` each, in any unit. A pixel with a value that is not
    finite in either is left out of the averages, and gets that of its neighbours.
    Returns the features of `following`.
    """
    steer, follow = jnp.stack(planes(tuple(steering))), jnp.stack(planes(tuple(following)))
    usable = jnp.all(jnp.isfinite(steer), axis=0) & jnp.all(jnp.isfinite(follow), axis=0)
    near = blur(jnp.where(usable, steer, 0))
    sums = _average(near, jnp.where(usable, follow, 0), usable.astype(follow.dtype))
    filtered = jnp.moveaxis(sums[1:] / jnp.maximum(sums[:1], 1e-12), 0, -1)
    ends = [layer.shape[-1] for layer in following]
    return tuple(filtered[..., sum(ends[:i]) : sum(ends[: i + 1])] for i in range(len(ends)))


def _average(near: jax.Array, follow: jax.Array, usable: jax.Array) -> jax.Array:
    """Sums of the weights and of the weighted planes over each window, `(1 + K, H, W)`.

    near: `(S, H, W)`, what must be alike. follow: `(K, H, W)`. usable: `(H, W)`, 0 or 1.
    """
    margin = ((0, 0), (REACH, REACH), (REACH, REACH))
    there = jnp.concatenate([usable[None], follow])
    # Outside nothing is usable.
    padded = [jnp.pad(a, margin) for a in (near / NEAR, there)]
    padded, steepness = lax.optimization_barrier((padded, structure(near) / ALIKE**2))

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        around = rows + 2 * REACH
        alike, values = (lax.dynamic_slice_in_dim(a, first, around, axis=1) for a in padded)
        return _windows(alike, values, lax.dynamic_slice_in_dim(steepness, first, rows, axis=1))

    return fill(jnp.zeros_like(there), 1, usable.shape[0], 1, ROWS, strip)


def _windows(near: jax.Array, there: jax.Array, steepness: jax.Array) -> jax.Array:
    """As `_average`, of some rows with their margins, both images with what is usable."""
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
        apart = across + (y * y + x * x) / WIDTH**2 + jnp.sum((other - here) ** 2, axis=0)
        return total + jnp.exp(-apart / 2) * values

    return lax.fori_loop(0, side**2, add, jnp.zeros((len(there), height, width), there.dtype))


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
    return lax.optimization_barrier((after - before) / 2)


def coverage(image: jax.Array, least: jax.Array | float) -> jax.Array:
    """Light, or albedo that shows lamps, as the share of what is brightest nearby.

    At the edge of something far brighter than white, the share of the pixel that it covers is
    what is alike along the edge. image: `(H, W, C)`. least: brightness below which nothing counts
    as bright, `()`. Returns `(H, W, C)`, about 0 to 1.
    """
    side = 2 * REACH + 1
    peak = jnp.max(jnp.where(jnp.isfinite(image), image, 0), axis=-1)
    peak = lax.reduce_window(peak, 0.0, lax.max, (side, side), (1, 1), "SAME")
    return image / jnp.maximum(blur(blur(peak[None]))[0], least)[..., None]


def blur(image: jax.Array) -> jax.Array:
    """The mean over 3 x 3 pixels with the weights 1, 2, 1, `(K, H, W)`; borders are repeated."""
    for axis in (1, 2):
        before, here, after = _three(image, axis)
        image = lax.optimization_barrier((before + 2 * here + after) / 4)
    return image


def _three(image: jax.Array, axis: int) -> list[jax.Array]:
    """The pixels before, those here and those after, along an axis; borders are repeated."""
    margin = [(1, 1) if a == axis else (0, 0) for a in range(3)]
    padded, size = jnp.pad(image, margin, mode="edge"), image.shape[axis]
    return [lax.slice_in_dim(padded, k, k + size, axis=axis) for k in range(3)]
