"""Moments of weighted pixels (section 3.2, kernel 1, with the weights of Eq. 9).

The same sums as `moments.collect` with a weight per pixel, and in the same order. Here the weighted
guides stay in the cache while their products are formed, which counts because every pixel has one.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from jflnr.regression.moments import (
    Guides,
    from_shift,
    plane_count,
    planes,
    sum_columns,
    working_type,
)
from jflnr.regression.strips import cut, fill, step_of


def collect_weighted(
    target: jax.Array,
    guides: Guides,
    shift: jax.Array,
    weight: jax.Array,
    squares: jax.Array,
    block: int,
    unit: jax.Array | float = 1,
) -> tuple[jax.Array, jax.Array]:
    """Mean over each block of the weighted outer products of [1, X - shift, Y], and of `squares`.

    target: `(H, W, C)`. guides: `(H, W, Q)`. shift: `(Q,)`. weight: `(H, W)`, finite and not
    negative, 0 where a pixel is not to be used. squares: `(H, W)`, finite. unit: what the target is
    divided by.
    Returns `(K, ceil(H/block), ceil(W/block))` and `(1, ceil(H/block), ceil(W/block))`.
    """

    def strip(first: jax.Array | int, rows: int) -> jax.Array:
        y, x, w, r = cut((target, guides, weight, squares), first, rows)
        return _strip(y / unit, x, w, r, shift, block)

    height, width = (-(-size // block) for size in target.shape[:2])
    count = plane_count(shift.size, target.shape[2]) + 1
    empty = jnp.zeros((count, height, width), working_type(target, *jax.tree.leaves(guides)))
    moments = fill(empty, 1, target.shape[0], block, step_of(block), strip)
    return moments[:-1], moments[-1:]


def _strip(
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
    products = [weight]
    for i in range(1, len(weighted)):
        products += [weighted[i], *(weighted[i] * x[j] for j in range(i))]
    products += [a * b for a in weighted for b in y]
    products.append(squares)
    # Rows first: contiguous additions; then the columns, with fewer data.
    missing = -target.shape[0] % block
    if missing:
        products = [jnp.pad(product, ((0, missing), (0, 0))) for product in products]
    sums = [jnp.sum(p.reshape(-1, block, p.shape[1]), axis=1) for p in products]
    together = lax.optimization_barrier(jnp.stack(lax.optimization_barrier(sums)))
    return sum_columns(together, block) / block**2
