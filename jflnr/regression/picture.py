"""A whole picture, with all its materials, denoised by one regression.

What reflects or transmits is `light = (beauty - emission - environment) / albedo`; the albedo
follows mirrors and glass, as a path tracer's denoising albedo does, and beyond white shows the
lamps that are seen in them. Emission and environment know no noise but that of their edges, and are
filtered as features are.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from jflnr.regression.adaptive import DEFAULT, AdaptiveFLR, flr_adaptive, light_of
from jflnr.regression.features import antialiased, coverage, filter_features

# Side in pixels of the blocks of the first pass, with 2 samples per pixel and more; with one, 4.
BLOCK = 2
# Darker surfaces are not divided by their albedo, which is hardly known.
LEAST_ALBEDO = 0.02
# Of what covers less of a pixel too little is known to learn from it.
LEAST_ALPHA = 0.02
# Layers in half precision are added up that exactly, relative to them.
ROUNDING = 2e-3
# A pixel so many times brighter than those around weighs as little as if it were no brighter.
FIREFLY, AROUND = 20, 3

GUIDES = "normal", "albedo", "seen_normal", "depth", "position"
# Depth and position of the pixels' centres are aliased, and would break thin lines.
STEERING = "albedo", "normal", "seen_normal", "emission", "environment", "alpha"


class Picture(NamedTuple):
    """What a renderer tells of a picture, `(H, W, C)` each; None where it does not.

    beauty: the noisy picture. albedo: of the light that is seen, also through mirrors and glass;
    with emission and environment added everywhere, as Cycles does, or nowhere. normal: unit.
    seen_normal: of what is seen in mirrors and through glass. depth: over its median. position:
    about a point of the scene, over the median depth. emission: seen directly. environment: seen
    directly. alpha: share of the pixel that is covered, on a transparent film, whose beauty does
    not hold the environment, and whose other layers hold 0 beyond.
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
    covered = jnp.ones((1,) * 3) if clean.alpha is None else jnp.clip(clean.alpha, 0, 1)
    surface = jnp.maximum(reflecting(clean, holds_light(picture)), LEAST_ALBEDO * covered)
    light = jnp.maximum(picture.beauty - own_light(picture), 0) / jnp.maximum(surface, 1e-6)
    weight = firefly_weight(light_of(light)) * (covered > LEAST_ALPHA)[..., 0]
    guiding = clean._replace(albedo=jnp.clip(clean.albedo, 0, 1))
    layers = [getattr(guiding, name) for name in GUIDES]
    guides = tuple(layer for layer in layers if layer is not None)
    fitted = flr_adaptive(light, guides, method, block=block, weight=weight)
    return clean._replace(beauty=jnp.maximum(fitted, 0) * surface + own_light(clean))


def own_light(picture: Picture) -> jax.Array:
    """What no surface reflects and beauty holds, `(H, W, 3)`: emission, and what is behind all."""
    behind = None if picture.alpha is not None else picture.environment
    return _sum(picture, picture.emission, behind)


def holds_light(picture: Picture) -> jax.Array:
    """Whether the albedo has emission and environment added to it, `()`."""
    own = _sum(picture, picture.emission, picture.environment)
    return jnp.all(~(picture.albedo < (1 - ROUNDING) * own - ROUNDING))


def reflecting(picture: Picture, lit: jax.Array) -> jax.Array:
    """The albedo of what reflects alone, `(H, W, 3)`. lit: as of `holds_light`."""
    own = _sum(picture, picture.emission, picture.environment)
    return jnp.maximum(picture.albedo - jnp.where(lit, own, 0), 0)


def _sum(picture: Picture, *parts: jax.Array | None) -> jax.Array:
    return sum((part for part in parts if part is not None), jnp.zeros_like(picture.beauty))


def filter_picture(picture: Picture) -> Picture:
    """Every layer but the beauty without its noise."""
    layers = {name: layer for name, layer in picture._asdict().items() if layer is not None}
    unit = jnp.maximum(jnp.nanmean(layers.pop("beauty")), 1e-12)
    steering = [steer(name, layer, unit) for name, layer in layers.items() if name in STEERING]
    filtered = filter_features(steering, list(layers.values()))
    return picture._replace(**dict(zip(layers, filtered, strict=True)))


def steer(name: str, layer: jax.Array, unit: jax.Array) -> jax.Array:
    """A layer so scaled that it varies by about 1. unit: brightness of the picture, `()`."""
    if name in ("emission", "environment"):
        return coverage(jnp.mean(layer, axis=-1, keepdims=True), unit)
    if name == "albedo":
        return coverage(layer, 1.0)
    return layer if name == "alpha" else layer / 2


def firefly_weight(light: jax.Array) -> jax.Array:
    """Less than 1 where a pixel is far brighter than those around it, `(H, W)` to `(H, W)`."""
    light = jnp.where(jnp.isfinite(light), light, 0)
    side = 2 * AROUND + 1
    total = lax.reduce_window(light, 0.0, lax.add, (side, side), (1, 1), "SAME")
    around = jnp.maximum(total - light, 0) / (side**2 - 1)
    return jnp.minimum(1, FIREFLY * around / jnp.where(light > 0, light, 1))
