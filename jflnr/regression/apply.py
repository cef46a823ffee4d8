"""Upsampling of the coefficients and evaluation of the model (section 3.2, kernel 4)."""

from __future__ import annotations

import numpy as np

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.floor import clamp_to_floor
from jflnr.regression.moments import Guides, from_shift, planes
from jflnr.regression.strips import cut, fill, step_of

# Rows of pixels that are worked on at a time: so many that the compiler divides the last step among
# the cores.
ROWS = 64


def apply(
    coefficients: jax.Array,
    guides: Guides,
    shift: jax.Array,
    block: int,
    floor: jax.Array | float | None = None,
) -> jax.Array:
    """Evaluate the models, interpolated bilinearly between block centres, on every pixel.

    The coefficients at pixel p are those at block coordinate `(p + 0.5)/block - 0.5`, clamped
    (section 3.2). They are never materialised at full resolution. A guide that is not finite
    counts as being at `shift`.

    coefficients: `(Q + 1, C, h, w)`, from `solve`. guides: `(H, W, Q)`. shift: `(Q,)`. floor: if
    given, coefficients are `(Q + 2, C, h, w)`, from `floor.with_own_light`, and no pixel is darker
    than this times the light of its block.
    Returns `(H, W, C)`.
    """
    # The first and the last row of blocks repeated, so the interpolation is clamped at the borders.
    coefficients = jnp.pad(coefficients, ((0, 0), (0, 0), (1, 1), (0, 0)), mode="edge")
    height, width = jax.tree.leaves(guides)[0].shape[:2]

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        models = lax.dynamic_slice_in_dim(coefficients, first // block, -(-rows // block) + 2, 2)
        return apply_strip(cut(guides, first, rows), models, shift, block, floor)

    image = jnp.zeros((height, width, coefficients.shape[1]), coefficients.dtype)
    return fill(image, 0, height, 1, step_of(block, ROWS), strip, align=block)


def guides_to_map(parts: dict) -> Guides:
    """The guides that the models are evaluated on (X_map of section 3.3): those of the fit, unless
    `guides_map` are others."""
    others = parts.get("guides_map")
    return parts["guides"] if others is None else others


def apply_strip(
    guides: Guides,
    coefficients: jax.Array,
    shift: jax.Array,
    block: int,
    floor: jax.Array | float | None = None,
) -> jax.Array:
    """`apply` on few rows of blocks, all at once, with one more of them above and below.

    Horizontally a row is cut into cells from one block centre to the next, where the model is
    `start + t difference`; the guides are multiplied in before t is, which halves the work.
    """
    rows, width = jax.tree.leaves(guides)[0].shape[:2]
    dtype, count = coefficients.dtype, coefficients.shape[2] - 2
    coefficients = jnp.pad(coefficients, ((0, 0), (0, 0), (0, 0), (1, 1)), mode="edge")
    above, here, below = (coefficients[:, :, k : k + count, None] for k in range(3))
    before, centre, after = (jnp.asarray(f, dtype)[:, None] for f in _hat(block))
    models = before * above + centre * here + after * below
    edges = models.reshape(*models.shape[:2], count * block, -1)[:, :, :rows]

    margin = block - block // 2
    cells = edges.shape[-1] - 1
    t = jnp.asarray((np.arange(block) - margin + 0.5) / block + 0.5, dtype)

    def into_cells(plane: jax.Array, shift: jax.Array) -> jax.Array:
        plane = plane.astype(dtype)
        guide = jnp.where(jnp.isfinite(plane), from_shift(plane, shift), 0)
        padded = jnp.pad(guide, ((0, 0), (margin, cells * block - margin - width)))
        return padded.reshape(rows, cells, block)

    x = [into_cells(plane, s) for plane, s in zip(planes(guides), shift, strict=True)]
    # Cheap to keep in the cache, dear to compute once per pixel and channel.
    start, difference, x = lax.optimization_barrier((edges[..., :-1], jnp.diff(edges), x))

    def pixels(values: jax.Array) -> jax.Array:
        return values.reshape(*values.shape[:2], -1)[..., margin : margin + width]

    at_start, change = start[0, ..., None], difference[0, ..., None]
    for q, guide in enumerate(x):
        at_start += guide * start[q + 1, ..., None]
        change += guide * difference[q + 1, ..., None]
    channels = pixels(at_start + t * change)
    if floor is not None:
        own = pixels(start[-1, ..., None] + t * difference[-1, ..., None])
        channels = clamp_to_floor(channels, own, floor)
    return jnp.moveaxis(channels, 0, -1)


def _hat(block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear weights of the block before, the block itself and the one after, `(block,)` each."""
    position = (np.arange(block) + 0.5) / block - 0.5
    before, after = np.maximum(-position, 0), np.maximum(position, 0)
    return before, 1 - before - after, after
