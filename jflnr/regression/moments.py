"""Moment collection: outer products of [1, X, Y], averaged over blocks (section 3.2, kernel 1).

The moments of a frame are one array `(K, h, w)`, one plane per distinct product, so that they can
be blurred like an image. First the lower triangle of `[1, X] [1, X]^T` row by row, then
`[1, X] Y^T` row by row: `K = (Q + 1)(Q + 2)/2 + (Q + 1) C`.
"""

from __future__ import annotations

import functools
from typing import TypeAlias

import numpy as np

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.strips import cut, fill, step_of

# One array `(H, W, Q)`, or several that make up the Q channels together, so that the layers of a
# frame need not be copied into one.
Guides: TypeAlias = "jax.Array | tuple[jax.Array, ...]"

# Guides are cut to within this of their shift, so that sums of squares, regularised, do not
# overflow in float32.
FARTHEST = 1e16

# Rows of pixels that stay in the cache while their products are formed, and keep cores busy.
TOGETHER = 24


def index_xx(i: int, j: int) -> int:
    """Plane of the moment of regressors i and j, where regressor 0 is the constant 1."""
    i, j = max(i, j), min(i, j)
    return i * (i + 1) // 2 + j


def index_xy(i: int, channel: int, guides: int, channels: int) -> int:
    """Plane of the moment of regressor i and a target channel."""
    return (guides + 1) * (guides + 2) // 2 + i * channels + channel


def plane_count(guides: int, channels: int) -> int:
    """The number K of moment planes for Q guides and C target channels."""
    return index_xy(guides + 1, 0, guides, channels)


def channels_of(moments: jax.Array, guides: int) -> int:
    """The number C of target channels in `(K, h, w)` moments of Q guides."""
    return (moments.shape[0] - index_xy(0, 0, guides, 0)) // (guides + 1)


def planes(image: Guides) -> list[jax.Array]:
    """The channels of an image `(H, W, Q)`, or of several, one by one."""
    return [layer[..., q] for layer in jax.tree.leaves(image) for q in range(layer.shape[-1])]


def centre(guides: Guides, weight: jax.Array | None = None) -> jax.Array:
    """A typical value of each guide, from a sparse grid of pixels.

    Moments are collected about it, since in float32 the variance of a guide far from zero (a world
    position) would drown in the square of its mean. Any value gives the same regression.

    guides: `(H, W, Q)`. weight: `(H, W)`, whose pixels of weight 0 (a sky said to be infinitely
    far) do not count, or None. Returns `(Q,)`.
    """
    counts = None if weight is None else _sparse(weight) > 0
    # Each by itself: a stack of them makes the whole program a tenth slower.
    values = [_sparse_mean(_sparse(plane), counts) for plane in planes(guides)]
    return lax.stop_gradient(jnp.stack(values) if values else jnp.zeros(0))


def unit_of(image: jax.Array) -> jax.Array:
    """A power of two near the largest value on a sparse grid of pixels, or 1.

    Dividing by it rounds nothing, and squares of what is left do not overflow.
    image: `(H, W, C)`. Returns a scalar.
    """
    sample = jnp.stack([_sparse(plane) for plane in planes(image)])
    sample = jnp.abs(sample.astype(working_type(sample)))
    largest = jnp.max(jnp.where(jnp.isfinite(sample), sample, 0))
    # One power less: the next one may be beyond the type.
    unit = jnp.ldexp(jnp.ones((), sample.dtype), jnp.frexp(largest)[1] - 1)
    return lax.stop_gradient(jnp.where(largest > 0, unit, 1))


def _sparse(plane: jax.Array) -> jax.Array:
    return plane[tuple(slice(None, None, max(size // 32, 1)) for size in plane.shape)]


def _sparse_mean(sample: jax.Array, counts: jax.Array | None) -> jax.Array:
    sample = sample.astype(working_type(sample))
    typical = jnp.abs(sample) < FARTHEST
    if counts is not None:
        typical &= counts
    total = jnp.sum(jnp.where(typical, sample, 0))
    return total / jnp.maximum(jnp.sum(typical), 1).astype(sample.dtype)


def from_shift(plane: jax.Array, shift: jax.Array) -> jax.Array:
    """A guide as the moments and the model take it: its distance from the shift, cut."""
    return jnp.clip(plane - shift, -FARTHEST, FARTHEST)


def usable(target: jax.Array, guides: Guides, weight: jax.Array | None) -> jax.Array:
    """Which pixels count, `(H, W)`: those that are finite and, by their weight, there."""
    layers = jax.tree.leaves((target, guides))
    finite = (jnp.all(jnp.isfinite(layer), axis=-1) for layer in layers)
    good = functools.reduce(jnp.logical_and, finite)
    if weight is None:
        return good
    return good & (weight if weight.dtype == bool else (weight > 0) & jnp.isfinite(weight))


def working_type(*arrays: jax.Array) -> jnp.dtype:
    """Moments are kept in float32 at least, whatever the frame is stored in."""
    return jnp.result_type(jnp.float32, *(array.dtype for array in arrays))


def collect(
    target: jax.Array,
    guides: Guides,
    shift: jax.Array,
    block: int,
    weight: jax.Array | None = None,
    brightness: jax.Array | None = None,
) -> jax.Array:
    """Mean over each block of the outer products of [1, X - shift, Y] (section 3.2, kernel 1).

    Sums are divided by `block`^2 also where a block hangs over the border: the moment of 1 with
    itself then says how much of the block there was.

    target: `(H, W, C)`. guides: `(H, W, Q)`. shift: `(Q,)`, from `centre`. weight: `(H, W)`,
    numbers or a boolean mask, or None; pixels of weight 0, and any that are not finite, are left
    out. brightness: `(C,)`, weights of the channels; if given, the mean squares of the brightness
    and of the weight are two more planes, the last.
    Returns `(K, ceil(H/block), ceil(W/block))`.
    """
    height, width = (-(-size // block) for size in target.shape[:2])
    count = plane_count(shift.size, target.shape[2]) + 2 * (brightness is not None)

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        images = cut((target, guides, weight), first, rows)
        side = min(rows, block)
        lines = jax.tree.map(lambda a: a.reshape(rows // side, side, *a.shape[1:]), images)
        make = functools.partial(_strip_moments, shift=shift, block=block, brightness=brightness)
        return jnp.moveaxis(jax.vmap(make)(*lines), 0, 1)

    empty = jnp.zeros((count, height, width), working_type(target, *jax.tree.leaves(guides)))
    return fill(empty, 1, target.shape[0], block, step_of(block, TOGETHER), strip)


def _strip_moments(
    target: jax.Array,
    guides: Guides,
    weight: jax.Array | None,
    *,
    shift: jax.Array,
    block: int,
    brightness: jax.Array | None,
) -> jax.Array:
    """Moments of one row of blocks: `(rows, W, ...)` to `(K, w)`."""
    dtype = working_type(target, *jax.tree.leaves(guides))
    x = [from_shift(p.astype(dtype), s) for p, s in zip(planes(guides), shift, strict=True)]
    # Divided before they are summed: radiance near the type's maximum must not overflow.
    y = [plane.astype(dtype) * (1 / block**2) for plane in planes(target)]
    good = usable(target, guides, weight)
    x = [jnp.where(good, plane, 0) for plane in x]
    y = [jnp.where(good, plane, 0) for plane in y]
    one = good.astype(dtype)
    # Kept in the cache, instead of computed anew for each product.
    one, x, y = lax.optimization_barrier((one, x, y))
    weighted = [one, *x]
    if weight is not None and weight.dtype != bool:
        one = jnp.where(good, weight, 0).astype(dtype)
        weighted = [one, *(one * plane for plane in x)]
    products = _products(weighted, x, y)
    if brightness is not None:
        light = sum(
            (b * plane for b, plane in zip(brightness, y, strict=True)), jnp.zeros_like(one)
        )
        products += [one * light * (light * block**2), one * one * (1 / block**2)]
    divided = np.arange(len(products)) >= len(weighted) * (len(weighted) + 1) // 2
    # Rows first: contiguous additions; then the columns, with an eighth of the data.
    sums = lax.optimization_barrier([jnp.sum(product, axis=0) for product in products])
    sums = sum_columns(lax.optimization_barrier(jnp.stack(sums)), block)
    return sums * np.where(divided, 1, 1 / block**2).astype(dtype)[:, None]


def _products(weighted: list[jax.Array], x: list[jax.Array], y: list[jax.Array]) -> list[jax.Array]:
    """Outer products of [1, X, Y] in the order of the planes. weighted: [1, X] by the weights."""
    products = [weighted[0]]
    for i in range(1, len(weighted)):
        products += [weighted[i], *(weighted[i] * x[j] for j in range(i))]
    return products + [a * b for a in weighted for b in y]


def sum_columns(planes: jax.Array, block: int) -> jax.Array:
    """Sums over every `block` columns: `(..., W)` to `(..., ceil(W / block))`."""
    missing = -planes.shape[-1] % block
    planes = jnp.pad(planes, [(0, 0)] * (planes.ndim - 1) + [(0, missing)])
    # Whole columns at a time: short sums along the last axis would be taken one by one.
    return functools.reduce(jnp.add, (planes[..., k::block] for k in range(block)))


def collect_weighted(
    target: jax.Array,
    guides: Guides,
    shift: jax.Array,
    weight: jax.Array,
    squares: jax.Array,
    block: int,
    unit: jax.Array | float = 1,
) -> tuple[jax.Array, jax.Array]:
    """`collect` with the weights of Eq. 9, a number for every pixel, and the mean of `squares`.

    The weighted guides stay in the cache while their products are formed, which counts because
    every pixel has a weight.

    target: `(H, W, C)`. guides: `(H, W, Q)`. shift: `(Q,)`. weight: `(H, W)`, finite and not
    negative, 0 where a pixel is not to be used. squares: `(H, W)`, finite. unit: what the target is
    divided by.
    Returns `(K, ceil(H/block), ceil(W/block))` and `(1, ceil(H/block), ceil(W/block))`.
    """

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        y, x, w, r = cut((target, guides, weight, squares), first, rows)
        return _weighted_strip(y / unit, x, w, r, shift, block)

    height, width = (-(-size // block) for size in target.shape[:2])
    count = plane_count(shift.size, target.shape[2]) + 1
    empty = jnp.zeros((count, height, width), working_type(target, *jax.tree.leaves(guides)))
    moments = fill(empty, 1, target.shape[0], block, step_of(block), strip)
    return moments[:-1], moments[-1:]


def _weighted_strip(
    target: jax.Array,
    guides: Guides,
    weight: jax.Array,
    squares: jax.Array,
    shift: jax.Array,
    block: int,
) -> jax.Array:
    """Moments of some rows of blocks: `(rows, W, ...)` to `(K + 1, ceil(rows / block), w)`."""
    used = weight > 0
    x = [
        jnp.where(used, from_shift(plane, s), 0)
        for plane, s in zip(planes(guides), shift, strict=True)
    ]
    y = [jnp.where(used, plane, 0) for plane in planes(target)]
    weighted = [weight, *(weight * plane for plane in x)]
    weighted, x, y = lax.optimization_barrier((weighted, x, y))
    products = [*_products(weighted, x, y), squares]
    # Rows first: contiguous additions; then the columns, with fewer data.
    missing = -target.shape[0] % block
    if missing:
        products = [jnp.pad(product, ((0, missing), (0, 0))) for product in products]
    sums = [jnp.sum(p.reshape(-1, block, p.shape[1]), axis=1) for p in products]
    together = lax.optimization_barrier(jnp.stack(lax.optimization_barrier(sums)))
    return sum_columns(together, block) / block**2
