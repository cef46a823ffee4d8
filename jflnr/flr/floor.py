"""A floor under the result: where a model falls too dark, the mean light of its block shows.

An affine model that is right in the mean may still be black, or below zero, at pixels whose guides
lie far from their mean: in gaps and corners that the window hardly knows.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from jflnr.flr.level import brightness


def with_own_light(coefficients: jax.Array, guides: jax.Array) -> jax.Array:
    """One more row below the models: the light that each gives at its block's mean guides.

    That is none where its brightness would be below zero.

    coefficients: `(Q + 1, C, h, w)`. guides: `(Q + 1, h, w)`, from `level.mean_guides`.
    Returns `(Q + 2, C, h, w)`.
    """
    own = jnp.sum(coefficients * guides[:, None], axis=0)
    own = own * (jnp.einsum("chw,c->hw", own, brightness(own.shape[0], own.dtype)) > 0)
    return jnp.concatenate([coefficients, own[None]])


def lift(
    channels: list[jax.Array], own: list[jax.Array], floor: jax.Array | float
) -> list[jax.Array]:
    """Mix in as much of the block's own light that the brightness is `floor` times its brightness.

    All channels are mixed by one share, so that light groups go on summing to the whole. Where a
    block has no light of its own nothing is mixed in.

    channels, own: images, one for each channel.
    """
    # The barriers: computed together, all this takes several times as long.
    channels, own = lax.optimization_barrier((channels, own))
    weights = brightness(len(channels), channels[0].dtype)
    light, whole = (
        lax.optimization_barrier(sum(w * plane for w, plane in zip(weights, image, strict=True)))
        for image in (channels, own)
    )
    # Squared, as its derivative does, the divisor must not vanish.
    share = jnp.maximum(floor * whole - light, 0) / jnp.maximum(whole - light, 1e-18)
    share = lax.optimization_barrier(share * (whole > 0))
    return [c + share * (o - c) for c, o in zip(channels, own, strict=True)]
