"""A floor under the result: where a model falls too dark, the mean light of its block shows.

An affine model that is right in the mean may still be black, or below zero, at pixels whose guides
lie far from their mean: in gaps and corners that the window hardly knows.
"""

from __future__ import annotations

from jflnr.lazy import jax, jnp
from jflnr.regression.level import brightness


def with_own_light(coefficients: jax.Array, guides: jax.Array) -> jax.Array:
    """One more row below the models: the light that each gives at its block's mean guides.

    That is none where its brightness would be below zero.

    coefficients: `(Q + 1, C, h, w)`. guides: `(Q + 1, h, w)`, from `level.mean_guides`.
    Returns `(Q + 2, C, h, w)`.
    """
    own = jnp.sum(coefficients * guides[:, None], axis=0)
    own = own * (jnp.einsum("chw,c->hw", own, brightness(own.shape[0], own.dtype)) > 0)
    return jnp.concatenate([coefficients, own[None]])


def clamp_to_floor(channels: jax.Array, own: jax.Array, floor: jax.Array | float) -> jax.Array:
    """Mix in as much of the block's own light that the brightness is `floor` times its brightness.

    All channels are mixed by one share, so that light groups go on summing to the whole. Where a
    block has no light of its own nothing is mixed in.

    channels, own: `(C, H, W)`. Returns the same.
    """
    weights = brightness(len(channels), channels.dtype)[:, None, None]
    # Sums along an axis: plane by plane, the compiler would find the light for every channel anew.
    light, whole = jnp.sum(weights * channels, axis=0), jnp.sum(weights * own, axis=0)
    # Squared, as its derivative does, the divisor must not vanish.
    share = jnp.maximum(floor * whole - light, 0) / jnp.maximum(whole - light, 1e-18)
    return channels + share * (whole > 0) * (own - channels)
