"""The light passes of a picture without their noise, so that they sum to its denoised beauty.

A pass is what one kind of surface (a lobe) does with direct or indirect light. Each is fitted
coarsely by itself; the fits tell what share of the denoised light is the pass's.
"""

from __future__ import annotations

from jflnr.lazy import jax, jnp, lax
from jflnr.regression.adaptive import flr_adaptive
from jflnr.regression.division import divide
from jflnr.regression.moments import Guides

# Darker colours are not divided by.
LEAST_COLOUR = 0.02
# Passes that lack less of the light are complete, but for rounding.
LACKING = 0.01


def split(
    reflected: jax.Array,
    noisy: jax.Array,
    passes: jax.Array,
    colours: tuple[jax.Array, jax.Array],
    guides: Guides,
    weight: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """Passes that sum to the denoised light, as those of the input do to the noisy light.

    reflected, noisy: `(H, W, 3)`, radiance with and without noise removed. passes: `(H, W, 6 n)`,
    noisy, direct and indirect light of n lobes, divided by their colours. colours: `(H, W, 3 n)`,
    as they were written, and without noise. guides, weight: as of `flr_adaptive`.
    Returns the passes divided by the colours without noise, and what none of them holds,
    `(H, W, 3)`. None is negative.
    """
    size = reflected.shape[:2]
    light = passes.reshape(*size, -1, 2, 3)
    given, clean = (colour.reshape(*size, -1, 1, 3) for colour in colours)
    radiance = jnp.maximum(light * given, 0)
    rest = jnp.maximum(noisy - jnp.sum(radiance, axis=(2, 3)), 0)
    rest = jnp.where(jnp.nansum(rest) > LACKING * jnp.nansum(noisy), rest, 0)
    parts = (radiance / jnp.maximum(clean, LEAST_COLOUR)).reshape(*size, -1, 3)
    targets = jnp.moveaxis(jnp.concatenate([parts, rest[:, :, None]], axis=2), 2, 0)
    # Passes go with their own colours, so that shares vary slowly: coarse fits will do.
    fits = lax.map(lambda part: flr_adaptive(part, guides, weight=weight), targets)
    fits = jnp.moveaxis(jnp.maximum(fits, 0), 0, 2)
    # Where no fit has light but the picture has, it is divided by colour.
    expected = fits[:, :, :-1].reshape(radiance.shape) * clean + 1e-6 * clean * jnp.mean(reflected)
    total = jnp.sum(expected, axis=(2, 3)) + fits[:, :, -1]
    each = divide(reflected, total)
    split = expected * each[:, :, None, None] / jnp.where(clean > 0, clean, 1)
    left = jnp.maximum(reflected - jnp.sum(split * clean, axis=(2, 3)), 0)
    return split.reshape(passes.shape), left
