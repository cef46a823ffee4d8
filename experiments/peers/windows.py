"""Sums over neighbours, as several peers need them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import jax
import jax.numpy as jnp

Sum = TypeVar("Sum")

LUMINANCE = (0.2126, 0.7152, 0.0722)


def box(image: jax.Array, radius: int) -> jax.Array:
    """Sum over the square of side `2 radius + 1`, zeros outside; `(H, W, ...)`, O(1) per pixel."""
    for axis in (0, 1):
        size = image.shape[axis]
        margins = [(radius + 1, radius) if a == axis else (0, 0) for a in range(image.ndim)]
        total = jnp.cumsum(jnp.pad(image, margins), axis=axis)
        upper = jax.lax.slice_in_dim(total, 2 * radius + 1, 2 * radius + 1 + size, axis=axis)
        image = upper - jax.lax.slice_in_dim(total, 0, size, axis=axis)
    return image


def over_offsets(
    step: Callable[[Sum, tuple[jax.Array, ...], jax.Array], Sum],
    start: Sum,
    images: tuple[jax.Array, ...],
    offsets: Sequence[tuple[int, int]],
) -> Sum:
    """Fold `step(sum, images moved by the offset, number of the offset)` over all offsets.

    images: `(H, W, C)` each; pixel p of a moved image is pixel p + offset, and 0 outside.
    """
    height, width = images[0].shape[:2]
    reach = max(max(abs(dy), abs(dx)) for dy, dx in offsets)
    padded = [jnp.pad(image, ((reach, reach), (reach, reach), (0, 0))) for image in images]
    table = jnp.asarray(offsets) + reach

    def body(k: jax.Array, total: Sum) -> Sum:
        y, x = table[k, 0], table[k, 1]
        moved = tuple(
            jax.lax.dynamic_slice(image, (y, x, 0), (height, width, image.shape[2]))
            for image in padded
        )
        return step(total, moved, k)

    return jax.lax.fori_loop(0, len(offsets), body, start)


def square(radius: int, dilation: int = 1) -> list[tuple[int, int]]:
    """Offsets (dy, dx) of a square of pixels, `dilation` apart."""
    span = range(-radius, radius + 1)
    return [(dilation * dy, dilation * dx) for dy in span for dx in span]


def luminance(image: jax.Array) -> jax.Array:
    """`(H, W, 3)` to `(H, W, 1)`."""
    return jnp.sum(image * jnp.asarray(LUMINANCE, image.dtype), axis=-1, keepdims=True)
