"""A whole picture, with all its materials, denoised by one regression.

What reflects or transmits is `light = (beauty - emission - environment) / albedo`; the albedo
follows mirrors and glass, as a path tracer's denoising albedo does. Emission and environment know
no noise but that of their edges, and are filtered as features are.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jflnr.regression.adaptive import DEFAULT, AdaptiveFLR, flr_adaptive, light_of
from jflnr.regression.features import antialiased, filter_features

# Side in pixels of the blocks of the first pass, with 2 samples per pixel and more; with one, 4.
BLOCK = 2
# Darker surfaces are not divided by their albedo, which is hardly known.
LEAST_ALBEDO = 0.02
# Of what covers less of a pixel too little is known to learn from it.
LEAST_ALPHA = 0.1
# A pixel so many times brighter than those around weighs as little as if it were no brighter.
FIREFLY, AROUND = 20, 3


class Picture(NamedTuple):
    """What a renderer tells of a picture, `(H, W, C)` each; None where it does not.

    beauty: the noisy picture. albedo: of the light that is seen, also through mirrors and glass.
    normal: unit. seen_normal: of what is seen in mirrors and through glass. depth: over its median.
    position: about a point of the scene, over the median depth. emission: seen directly.
    environment: seen directly; None on a transparent film, whose beauty does not hold it. alpha:
    share of the pixel that is covered.
    """

    beauty: jax.Array
    albedo: jax.Array
    normal: jax.Array
    seen_normal: jax.Array | None = None
    depth: jax.Array | None = None
    position: jax.Array | None = None
    emission: jax.Array | None = None
    environment: jax.Array | None = None
    alpha: jax.Array | None = None


def denoise_picture(
    picture: Picture,
    method: AdaptiveFLR = DEFAULT,
    *,
    block: int = BLOCK,
    filtered: bool | None = None,
) -> Picture:
    """The picture without noise: beauty, and filtered every layer that came with it.

    Scales with beauty, emission and environment. No light is negative.

    method: constants of the fit. block: as of `AdaptiveFLR`. filtered: whether the layers are
    antialiased, and so have noise to be filtered; None to tell by the normals.
    """
    clean = picture if filtered is False else filter_picture(picture)
    if filtered is None:
        noisy = antialiased(picture.normal)
        clean = jax.tree.map(lambda new, old: jnp.where(noisy, new, old), clean, picture)
    surface = jnp.clip(clean.albedo, LEAST_ALBEDO, 1)
    opaque = jnp.ones(surface.shape[:2], bool)
    if clean.alpha is not None:
        surface, opaque = surface * jnp.clip(clean.alpha, 0, 1), clean.alpha[..., 0] > LEAST_ALPHA
    light = jnp.maximum(picture.beauty - own_light(picture), 0) / jnp.maximum(surface, 1e-6)
    weight = firefly_weight(light_of(light)) * opaque
    layers = (clean.normal, clean.albedo, clean.seen_normal, clean.depth, clean.position)
    guides = tuple(layer for layer in layers if layer is not None)
    fitted = flr_adaptive(light, guides, method, block=block, weight=weight)
    return clean._replace(beauty=jnp.maximum(fitted, 0) * surface + own_light(clean))


def own_light(picture: Picture) -> jax.Array:
    """Emission and environment, `(H, W, 3)`: what no surface reflects."""
    parts = (picture.emission, picture.environment)
    return sum((part for part in parts if part is not None), jnp.zeros_like(picture.beauty))


def filter_picture(picture: Picture) -> Picture:
    """Every layer but the beauty without its noise; the albedo cut to 1."""
    picture = picture._replace(albedo=jnp.clip(picture.albedo, 0, 1))
    layers = {name: layer for name, layer in picture._asdict().items() if layer is not None}
    unit = jnp.nanmean(layers.pop("beauty"))
    steering = [steer(name, layer, unit) for name, layer in layers.items()]
    filtered = filter_features(steering, list(layers.values()))
    return picture._replace(**dict(zip(layers, filtered, strict=True)))


def steer(name: str, layer: jax.Array, unit: jax.Array) -> jax.Array:
    """A layer so scaled that it varies by about 1. unit: brightness of the picture, `()`."""
    if name in ("emission", "environment"):
        light = jnp.mean(layer, axis=-1, keepdims=True)
        return light / (jnp.abs(light) + jnp.maximum(unit, 1e-12))
    return layer if name in ("albedo", "alpha") else layer / 2


def firefly_weight(light: jax.Array) -> jax.Array:
    """Less than 1 where a pixel is far brighter than those around it, `(H, W)` to `(H, W)`."""
    light = jnp.where(jnp.isfinite(light), light, 0)
    side = 2 * AROUND + 1
    total = lax.reduce_window(light, 0.0, lax.add, (side, side), (1, 1), "SAME")
    around = jnp.maximum(total - light, 0) / (side**2 - 1)
    return jnp.minimum(1, FIREFLY * around / jnp.where(light > 0, light, 1))
