"""Passes over the pixels strip by strip, so that what happens to a strip stays in the cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jflnr.lazy import jax, jnp, lax

# Rows of pixels that are worked on at a time: enough to keep cores busy.
ROWS = 16
# Blocks of a grid that are worked on at a time, about.
TOGETHER = 4096


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
) -> jax.Array:
    """Fill `array` along `axis`, where it has a row for every `block` rows of pixels.

    Nothing but the array itself is as large as the frame: strips that were put together afterwards
    would be there twice.

    height: of the frame, in pixels. step: rows of pixels at a time, a multiple of `block`. make:
    what belongs into the array for some rows of pixels, given the first and their number.
    """
    whole, rest = divmod(height, step)

    def add(strip: jax.Array | int, array: jax.Array, rows: int) -> jax.Array:
        made = make(strip * step, rows)
        return lax.dynamic_update_slice_in_dim(array, made, strip * (step // block), axis)

    if whole:
        array = lax.fori_loop(0, whole, lambda strip, array: add(strip, array, step), array)
    return add(whole, array, rest) if rest else array


def cut(images: Any, first: jax.Array | int, rows: int) -> Any:
    """Some rows of every image `(H, W, ...)` of a pytree."""
    return jax.tree.map(lambda image: lax.dynamic_slice_in_dim(image, first, rows), images)


def map_rows(make: Callable[[Any], Any], planes: Any) -> Any:
    """`make` of a few rows of a grid of blocks at a time.

    planes: pytree of `(..., h, w)`, of which `make` takes some rows and returns a pytree of such
    planes.
    """
    height, width = jax.tree.leaves(planes)[0].shape[-2:]
    rows = min(max(TOGETHER // width, 1), height)

    def some(first: jax.Array | int) -> Any:
        return jax.tree.map(lambda a: lax.dynamic_slice_in_dim(a, first, rows, a.ndim - 2), planes)

    def add(strip: jax.Array, whole: Any) -> Any:
        # The last strip ends with the grid; what it shares with the one before is the same.
        first = jnp.minimum(strip * rows, height - rows)
        made = make(lax.optimization_barrier(some(first)))
        put = lambda a, b: lax.dynamic_update_slice_in_dim(a, b, first, a.ndim - 2)
        return jax.tree.map(put, whole, made)

    shapes = jax.eval_shape(make, some(0))
    empty = lambda a: jnp.zeros((*a.shape[:-2], height, width), a.dtype)
    return lax.fori_loop(0, -(-height // rows), add, jax.tree.map(empty, shapes))
