"""Other frames from one: mirrored, with other colours."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

from jflnr.flnr import features, unet
from jflnr.flnr.examples import Example

PACKED = features.OF_GRID + features.OF_STEP + features.CHANNELS


def augment(key: jax.Array, example: Example) -> Example:
    """Mirror the crop and permute its channels, at random."""
    keys = jax.random.split(key, 3)
    example = _recolour(example, jax.random.permutation(keys[0], features.CHANNELS))
    for axis, own in enumerate(keys[1:]):
        example = _mirror(example, axis, jax.random.bernoulli(own))
    return example


def _with_planes(
    example: Example,
    change: Callable[[jax.Array], jax.Array],
    change_rest: Callable[[jax.Array], jax.Array] = lambda rest: rest,
) -> Example:
    """Change the planes `(PACKED, h, w)` of the finest blocks in `x`, and its other channels."""
    x = example.prepared.x
    planes = unet.unpack(x[..., : 4 * PACKED], 2 * x.shape[0], 2 * x.shape[1])
    x = jnp.concatenate([unet.pack(change(planes)), change_rest(x[..., 4 * PACKED :])], axis=-1)
    return example._replace(prepared=example.prepared._replace(x=x))


def _recolour(example: Example, order: jax.Array) -> Example:
    first = PACKED - features.CHANNELS
    example = _with_planes(example, lambda p: p.at[first:].set(p[first:][order]))
    known = example.prepared
    known = known._replace(
        coarsest=known.coarsest[:, order],
        differences=tuple(difference[:, order] for difference in known.differences),
    )
    albedo, target = example.albedo[..., order], example.target[..., order]
    return example._replace(prepared=known, albedo=albedo, target=target)


def _mirror(example: Example, axis: int, mirrored: jax.Array) -> Example:
    def image(a: jax.Array) -> jax.Array:
        return jnp.where(mirrored, jnp.flip(a, axis), a)

    def planes(a: jax.Array) -> jax.Array:
        return jnp.where(mirrored, jnp.flip(a, axis - 2), a)

    example = _with_planes(example, planes, image)
    known = example.prepared
    # All but what the network reads and the brightness of the frame.
    flipped = dict(zip(known._fields[1:-1], jax.tree.map(planes, known[1:-1]), strict=True))
    return example._replace(
        prepared=known._replace(**flipped),
        guides=image(example.guides),
        albedo=image(example.albedo),
        target=image(example.target),
    )
