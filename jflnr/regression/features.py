"""The feature filter: guides of a path tracer, with little noise and sharp edges.

Albedo, normal, emission and alpha of a few samples per pixel hold at an edge a noisy share of what
lies on either side; depth and position may be those of the pixel's centre, neither antialiased nor
defocused. All of them share their edges. Blurred, they tell how far a pixel is from an edge, with
far less noise than the pixel itself: so every feature is averaged over the pixels nearby whose
blurred features are alike, which lie along the edge.
"""

from __future__ import annotations

from collections.abc import Sequence

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.moments import planes
from jflnr.regression.strips import ROWS, fill

# Pixels on each side of a window of 5 x 5, and the standard deviation of its weights.
REACH, WIDTH = 2, 1.5
# How far blurred features may differ, one standard deviation, where features vary by about 1. The
# share of an edge that 4 samples tell is off by up to 0.25, blurred by 0.1; of two pixels, 0.14.
ALIKE = 0.15


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
    near = blur(jnp.where(usable, steer, 0)) / ALIKE
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
    padded = lax.optimization_barrier((jnp.pad(near, margin), jnp.pad(there, margin)))

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        around = rows + 2 * REACH
        return _windows(*(lax.dynamic_slice_in_dim(a, first, around, axis=1) for a in padded))

    return fill(jnp.zeros_like(there), 1, usable.shape[0], 1, ROWS, strip)


def _windows(near: jax.Array, there: jax.Array) -> jax.Array:
    """As `_average`, of some rows with their margins, and both images with what is usable."""
    height, width = (size - 2 * REACH for size in near.shape[1:])
    side = 2 * REACH + 1
    here = near[:, REACH : REACH + height, REACH : REACH + width]

    def add(tap: jax.Array, total: jax.Array) -> jax.Array:
        i, j = tap // side, tap % side
        other, values = (
            lax.dynamic_slice(a, (0, i, j), (len(a), height, width)) for a in (near, there)
        )
        apart = ((i - REACH) ** 2 + (j - REACH) ** 2) / WIDTH**2
        likeness = jnp.exp(-(jnp.sum((other - here) ** 2, axis=0) + apart) / 2)
        return total + likeness * values

    return lax.fori_loop(0, side**2, add, jnp.zeros((len(there), height, width), there.dtype))


def blur(image: jax.Array) -> jax.Array:
    """The mean over 3 x 3 pixels with the weights 1, 2, 1, `(K, H, W)`; borders are repeated."""
    for axis in (1, 2):
        margin = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        padded, size = jnp.pad(image, margin, mode="edge"), image.shape[axis]
        before, here, after = (lax.slice_in_dim(padded, k, k + size, axis=axis) for k in range(3))
        image = lax.optimization_barrier((before + 2 * here + after) / 4)
    return image
