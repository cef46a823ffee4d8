"""Passes over the pixels strip by strip, so that what happens to a strip stays in the cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jflnr.lazy import jax, jnp, lax

# Rows of pixels that are worked on at a time: enough to keep cores busy.
ROWS = 16


def step_of(block: int, rows: int = ROWS) -> int:
    """About so many rows of pixels, in whole rows of blocks."""
    return max(rows // block, 1) * block


def fill(
    array: jax.Array,
    axis: int,
    height: int,
    block: int,
    step: int,
    make: Callable[[jax.Array | int, int], jax.Array],
    align: int | None = None,
) -> jax.Array:
    """Fill `array` along `axis`, where it has a row for every `block` rows of pixels.

    Nothing but the array itself is as large as the frame: strips that were put together afterwards
    would be there twice. All strips are alike, since the compiler takes its time for each kind, but
    for what lies beyond the last multiple of `align`.

    height: of the frame, in pixels. step: rows of pixels at a time, at most, a multiple of `align`,
    where strips begin; it is a multiple of `block`, or that if None. make: what belongs into the
    array for some rows of pixels, given the first and their number.
    """
    align = align or block
    end = height - height % align

    def add(first: jax.Array | int, array: jax.Array, rows: int) -> jax.Array:
        return lax.dynamic_update_slice_in_dim(array, make(first, rows), first // block, axis)

    if end:
        count = -(-end // step)
        rows = -(-end // (count * align)) * align
        # The last strip ends with the frame; what it shares with the one before is the same.
        first = lambda strip: jnp.minimum(strip * rows, end - rows)
        array = lax.fori_loop(0, count, lambda i, array: add(first(i), array, rows), array)
    return add(end, array, height - end) if end < height else array


def cut(images: Any, first: jax.Array | int, rows: int, axis: int = 0) -> Any:
    """Some rows of every image `(H, W, ...)` of a pytree, or along another axis."""
    return jax.tree.map(lambda image: lax.dynamic_slice_in_dim(image, first, rows, axis), images)
