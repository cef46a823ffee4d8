"""Moment collection: outer products of [1, X, Y], averaged over blocks (section 3.2, kernel 1).

The moments of a frame are one array `(K, h, w)`, one plane per distinct product, so that they can
be blurred like an image. First the lower triangle of `[1, X] [1, X]^T` row by row, then
`[1, X] Y^T` row by row: `K = (Q + 1)(Q + 2)/2 + (Q + 1) C`.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax


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


def centre(guides: jax.Array) -> jax.Array:
    """A typical value of each guide, from a sparse grid of pixels.

    Moments are collected about it, since in float32 the variance of a guide far from zero (a world
    position) would drown in the square of its mean. Any value gives the same regression.

    guides: `(H, W, Q)`. Returns `(Q,)`.
    """
    step = [max(size // 32, 1) for size in guides.shape[:2]]
    sample = guides[:: step[0], :: step[1]].astype(working_type(guides))
    finite = jnp.isfinite(sample)
    total = jnp.sum(jnp.where(finite, sample, 0) / finite.size, axis=(0, 1))
    share = jnp.sum(finite, axis=(0, 1)) / finite.size
    return lax.stop_gradient(total / jnp.maximum(share, 1 / finite.size).astype(total.dtype))


def working_type(*arrays: jax.Array) -> jnp.dtype:
    """Moments are kept in float32 at least, whatever the frame is stored in."""
    return jnp.result_type(jnp.float32, *(array.dtype for array in arrays))


def usable(target: jax.Array, guides: jax.Array, weight: jax.Array | None) -> jax.Array:
    """`(H, W)`: True where a pixel takes part in the fit: all finite and weight above 0."""
    good = jnp.all(jnp.isfinite(target), axis=-1) & jnp.all(jnp.isfinite(guides), axis=-1)
    return good if weight is None else good & (weight > 0) & jnp.isfinite(weight)


def collect(
    target: jax.Array,
    guides: jax.Array,
    shift: jax.Array,
    block: int,
    weight: jax.Array | None = None,
) -> jax.Array:
    """Mean over each block of the outer products of [1, X - shift, Y] (section 3.2, kernel 1).

    Sums are divided by `block`^2 also where a block hangs over the border: the moment of 1 with
    itself then says how much of the block there was.

    target: `(H, W, C)`. guides: `(H, W, Q)`. shift: `(Q,)`, from `centre`. weight: `(H, W)` or
    None; pixels of weight 0, and any that are not finite, are left out.
    Returns `(K, ceil(H/block), ceil(W/block))`.
    """
    height, width = target.shape[:2]
    rows = height // block
    inputs = (target, guides) if weight is None else (target, guides, weight)

    def strip(arrays: tuple[jax.Array, ...]) -> jax.Array:
        return _strip_moments(*arrays, shift=shift, block=block)

    # A strip of one block row stays in the cache while its products are formed.
    whole = [a[: rows * block].reshape(rows, block, *a.shape[1:]) for a in inputs]
    moments = lax.map(strip, tuple(whole))
    if height % block:
        rest = strip(tuple(a[rows * block :] for a in inputs))
        moments = jnp.concatenate([moments, rest[None]])
    return jnp.moveaxis(moments, 0, 1)


def _strip_moments(
    target: jax.Array,
    guides: jax.Array,
    weight: jax.Array | None = None,
    *,
    shift: jax.Array,
    block: int,
) -> jax.Array:
    """Moments of one row of blocks: `(rows, W, ...)` to `(K, w)`."""
    dtype = working_type(target, guides)
    good = usable(target, guides, weight)
    one = good.astype(dtype) if weight is None else jnp.where(good, weight, 0).astype(dtype)
    x = [jnp.where(good, guides[..., q].astype(dtype) - shift[q], 0) for q in range(shift.size)]
    y = [jnp.where(good, target[..., c].astype(dtype), 0) for c in range(target.shape[-1])]
    weighted = [one] + (x if weight is None else [one * a for a in x])
    products = [one]
    products += [weighted[i] * x[j - 1] if j else weighted[i] for i in range(1, len(weighted)) for j in range(i + 1)]
    products += [a * b for a in weighted for b in y]
    # Rows first: contiguous additions; then the columns, with an eighth of the data.
    sums = jnp.stack([jnp.sum(product, axis=0) for product in products])
    missing = -sums.shape[1] % block
    sums = jnp.pad(sums, ((0, 0), (0, missing))).reshape(len(products), -1, block)
    return jnp.sum(sums, axis=-1) / block**2
