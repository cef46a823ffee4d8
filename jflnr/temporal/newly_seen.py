"""What has just come into view, kept near what its surroundings have long shown."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jflnr.frame import Array
from jflnr.regression.adaptive import light_of
from jflnr.regression.division import divide

# Pixels to each side that are looked at, by how much of a pixel's depth they may differ in theirs,
# and how many times brighter or darker than they a new pixel may be.
AROUND, NEAR, BRIGHTER = 2, 0.01, 1.5


def bounded(image: jax.Array, known: jax.Array, weight: jax.Array, depth: Array) -> jax.Array:
    """The fit of a frame, where new pixels are about as bright as those around them.

    The less noise a fit sees the steeper its models are, and the farther they lead where a pixel's
    guides are like no other's: on joints between tiles, which come into view in every frame.

    image: `(H, W, C)`. known: `(H, W)`, boolean, where the frame before showed the same place; all
    else is new. weight: `(H, W)`, how much a pixel counts. depth: `(H, W, 1)`. A new pixel without
    any of its depth around it that is known stays as it is, so does what is not positive.
    """
    height, width = known.shape
    light, depth = light_of(image), jnp.asarray(depth)[..., 0]
    seen = total = summed = jnp.zeros_like(light)
    padded = [jnp.pad(plane, AROUND) for plane in (known, weight, light, depth)]
    for down in range(2 * AROUND + 1):
        for right in range(2 * AROUND + 1):
            old, counts, shown, far = (
                plane[down : down + height, right : right + width] for plane in padded
            )
            counts = jnp.where(jnp.abs(far - depth) < NEAR * depth, counts, 0)
            seen += jnp.where(old, counts, 0)
            total += counts
            summed += jnp.where(counts > 0, counts * shown, 0)
    mean = divide(summed, total)
    share = divide(jnp.clip(light, mean / BRIGHTER, mean * BRIGHTER), light)
    new = ~known & (seen > 0) & (light > 0)
    return jnp.where(new[..., None], image * share[..., None], image)
