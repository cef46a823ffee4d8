"""Grids of blocks, each half as fine as the one before."""

from __future__ import annotations

import jax
import jax.numpy as jnp


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
    planes = _double_last(jnp.swapaxes(_double_last(planes), -1, -2))
    return jnp.swapaxes(planes, -1, -2)[..., :height, :width]


def _double_last(planes: jax.Array) -> jax.Array:
    before = jnp.concatenate([planes[..., :1], planes[..., :-1]], axis=-1)
    after = jnp.concatenate([planes[..., 1:], planes[..., -1:]], axis=-1)
    halves = jnp.stack([before + 3 * planes, after + 3 * planes], axis=-1) / 4
    return halves.reshape(*planes.shape[:-1], -1)
