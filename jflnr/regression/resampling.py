"""Grids of blocks, each half as fine as the one before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jflnr.lazy import jax, jnp, lax


def halve(planes: jax.Array) -> jax.Array:
    """Mean of 2 x 2 blocks, zeros beyond the border: `(K, h, w)` to `(K, ceil(h/2), ceil(w/2))`.

    Dividing by four at the border too keeps moments what `collect` makes them.
    """
    count, height, width = planes.shape
    planes = jnp.pad(planes, ((0, 0), (0, height % 2), (0, width % 2)))
    height, width = -(-height // 2), -(-width // 2)
    return jnp.mean(planes.reshape(count, height, 2, width, 2), axis=(2, 4))


def halve_inside(planes: jax.Array) -> jax.Array:
    """Mean of those of 2 x 2 blocks inside the border: `(..., h, w)` likewise."""
    whole = halve(jnp.ones((1, *planes.shape[-2:]), planes.dtype))
    means = halve(planes.reshape(-1, *planes.shape[-2:])) / whole
    return means.reshape(*planes.shape[:-2], *whole.shape[1:])


def double(planes: jax.Array, height: int, width: int) -> jax.Array:
    """Bilinear interpolation between block centres, clamped: `(..., h, w)` to `(..., 2h, 2w)`.

    Cut to `(..., height, width)`.
    """
    *lead, h, w = planes.shape
    around = [(0, 0)] * len(lead) + [(1, 1), (1, 1)]
    # The barriers: interleaving and interpolating at once takes several times as long.
    planes = lax.optimization_barrier(jnp.pad(planes, around, mode="edge"))
    rows = lax.optimization_barrier(_halves(planes, planes.ndim - 2))
    columns = lax.optimization_barrier(_halves(rows, planes.ndim))
    doubled = jnp.moveaxis(columns, (0, 1), (-1, -3)).reshape(*lead, 2 * h, 2 * w)
    return doubled[..., :height, :width]


def double_all(arrays: Sequence[jax.Array], height: int, width: int) -> list[jax.Array]:
    """`double` of several, which compiles in the time of one."""
    planes = [array.reshape(-1, *array.shape[-2:]) for array in arrays]
    doubled = double(jnp.concatenate(planes), height, width)
    parts = jnp.split(doubled, np.cumsum([len(p) for p in planes])[:-1])
    return [p.reshape(*a.shape[:-2], height, width) for p, a in zip(parts, arrays, strict=True)]


def _halves(planes: jax.Array, axis: int) -> jax.Array:
    """Values a quarter of a block before and after the blocks' centres, without the outer two:
    `(2, ...)`."""
    size = planes.shape[axis]
    before, here, after = (lax.slice_in_dim(planes, k, size - 2 + k, axis=axis) for k in range(3))
    return jnp.stack([(before + 3 * here) / 4, (after + 3 * here) / 4])
