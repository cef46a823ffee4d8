"""Grids of blocks, each half as fine as the one before."""

from __future__ import annotations

from jflnr.lazy import jax, jnp, lax


def halve(planes: jax.Array) -> jax.Array:
    """Mean of 2 x 2 blocks, zeros beyond the border: `(K, h, w)` to `(K, ceil(h/2), ceil(w/2))`.

    Dividing by four at the border too keeps moments what `collect` makes them.
    """
    count, height, width = planes.shape
    planes = jnp.pad(planes, ((0, 0), (0, height % 2), (0, width % 2)))
    height, width = -(-height // 2), -(-width // 2)
    return jnp.mean(planes.reshape(count, height, 2, width, 2), axis=(2, 4))


def double(planes: jax.Array, height: int, width: int) -> jax.Array:
    """Bilinear interpolation between block centres, clamped: `(..., h, w)` to `(..., 2h, 2w)`.

    Cut to `(..., height, width)`.
    """
    *lead, h, w = planes.shape
    around = [(0, 0)] * len(lead) + [(1, 1), (1, 1)]
    # The barriers: interleaving and interpolating at once takes several times as long.
    planes = lax.optimization_barrier(jnp.pad(planes, around, mode="edge"))
    rows = []
    for row in _halves(planes, planes.ndim - 2):
        columns = lax.optimization_barrier(_halves(row, row.ndim - 1))
        rows.append(jnp.stack(columns, axis=-1).reshape(*lead, h, 2 * w))
    doubled = jnp.stack(lax.optimization_barrier(rows), axis=-2).reshape(*lead, 2 * h, 2 * w)
    return doubled[..., :height, :width]


def _halves(planes: jax.Array, axis: int) -> tuple[jax.Array, jax.Array]:
    """Values a quarter of a block before and after the blocks' centres, without the outer two."""
    size = planes.shape[axis]
    before, here, after = (lax.slice_in_dim(planes, k, size - 2 + k, axis=axis) for k in range(3))
    return (before + 3 * here) / 4, (after + 3 * here) / 4
