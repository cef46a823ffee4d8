"""Upsampling of the coefficients and evaluation of the model (section 3.2, kernel 4)."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jflnr.flr.moments import Guides, from_shift, into_strips, planes


def apply(coefficients: jax.Array, guides: Guides, shift: jax.Array, block: int) -> jax.Array:
    """Evaluate the models, interpolated bilinearly between block centres, on every pixel.

    The coefficients at pixel p are those at block coordinate `(p + 0.5)/block - 0.5`, clamped
    (section 3.2). They are never materialised at full resolution. A guide that is not finite
    counts as being at `shift`.

    coefficients: `(Q + 1, C, h, w)`, from `solve`. guides: `(H, W, Q)`. shift: `(Q,)`.
    Returns `(H, W, C)`.
    """
    return apply_rows(with_borders(coefficients), guides, shift, block)


def with_borders(coefficients: jax.Array) -> jax.Array:
    """The first and the last row of blocks repeated: `(Q + 1, C, h, w)` to `(Q + 1, C, h + 2, w)`.

    So the interpolation is clamped at a frame's borders.
    """
    return jnp.pad(coefficients, ((0, 0), (0, 0), (1, 1), (0, 0)), mode="edge")


def apply_rows(coefficients: jax.Array, guides: Guides, shift: jax.Array, block: int) -> jax.Array:
    """`apply` on some whole rows of blocks of a frame.

    coefficients: `(Q + 1, C, h + 2, w)`, with the rows of blocks above and below.
    """
    height = jax.tree.leaves(guides)[0].shape[0]
    rows = height // block
    size = coefficients.shape[2] - 2
    moved = (lax.slice_in_dim(coefficients, k, k + size, axis=2) for k in range(3))
    grids = [jnp.moveaxis(grid, 2, 0) for grid in moved]

    def strip(guides: Guides, grids: list[jax.Array]) -> jax.Array:
        return _apply_strip(guides, *grids, shift=shift, block=block)

    def strip_of(arrays: tuple[jax.Array, list[jax.Array]]) -> jax.Array:
        first, grids = arrays
        cut = functools.partial(lax.dynamic_slice_in_dim, start_index=first, slice_size=block)
        return strip(jax.tree.map(cut, guides), grids)

    inside = [grid[:rows] for grid in grids]
    if height % block == 0:
        whole = jax.tree.map(lambda a: into_strips(a, block), guides)
        image = lax.map(lambda arrays: strip(*arrays), (whole, inside))
        return image.reshape(height, *image.shape[2:])
    rest = strip(jax.tree.map(lambda a: a[rows * block :], guides), [grid[rows] for grid in grids])
    if not rows:
        return rest
    # Cut out one by one: the guides without their last rows would be a copy of them.
    image = lax.map(strip_of, (jnp.arange(rows) * block, inside))
    return jnp.concatenate([image.reshape(rows * block, *rest.shape[1:]), rest])


def _apply_strip(
    guides: Guides,
    above: jax.Array,
    here: jax.Array,
    below: jax.Array,
    *,
    shift: jax.Array,
    block: int,
) -> jax.Array:
    """One row of blocks: guides `(rows, W, Q)` and three rows of models `(Q + 1, C, w)`.

    Horizontally the row is cut into cells from one block centre to the next, where the model is
    `start + t difference`; the guides are multiplied in before t is, which halves the work.
    """
    rows, width = jax.tree.leaves(guides)[0].shape[:2]
    before, centre, after = (jnp.asarray(f, here.dtype)[:rows, None] for f in _hat(block))
    models = before * above[:, :, None] + centre * here[:, :, None] + after * below[:, :, None]
    edges = jnp.concatenate([models[..., :1], models, models[..., -1:]], axis=-1)

    margin = block - block // 2
    cells = edges.shape[-1] - 1
    t = jnp.asarray((np.arange(block) - margin + 0.5) / block + 0.5, here.dtype)

    def into_cells(plane: jax.Array, shift: jax.Array) -> jax.Array:
        plane = plane.astype(here.dtype)
        guide = jnp.where(jnp.isfinite(plane), from_shift(plane, shift), 0)
        padded = jnp.pad(guide, ((0, 0), (margin, cells * block - margin - width)))
        return padded.reshape(rows, cells, block)

    x = [into_cells(plane, s) for plane, s in zip(planes(guides), shift, strict=True)]
    # Cheap to keep in the cache, dear to compute once per pixel and channel.
    start, difference, x = lax.optimization_barrier((edges[..., :-1], jnp.diff(edges), x))
    channels = []
    for c in range(here.shape[1]):
        at_start, change = start[0, c, ..., None], difference[0, c, ..., None]
        for q, guide in enumerate(x):
            at_start += guide * start[q + 1, c, ..., None]
            change += guide * difference[q + 1, c, ..., None]
        value = (at_start + t * change).reshape(rows, -1)
        channels.append(value[:, margin : margin + width])
    return jnp.stack(lax.optimization_barrier(channels), axis=-1)


def _hat(block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear weights of the block before, the block itself and the one after, `(block,)` each."""
    position = (np.arange(block) + 0.5) / block - 0.5
    before, after = np.maximum(-position, 0), np.maximum(position, 0)
    return before, 1 - before - after, after
