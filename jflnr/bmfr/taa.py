"""Temporal anti-aliasing (Karis 2014, "High Quality Temporal Supersampling"), phase III of BMFR."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.scipy.ndimage import map_coordinates

from jflnr.frame import Array
from jflnr.regression.division import divide

# Luma, orange and green of a colour; halves and quarters, so that the way back loses nothing.
YCOCG = ((0.25, 0.5, 0.25), (0.5, 0.0, -0.5), (-0.25, 0.5, -0.25))
RGB = ((1.0, 1.0, -1.0), (1.0, 0.0, 1.0), (1.0, -1.0, -1.0))
CROSS = ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1))
CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def smooth(
    picture: Array, before: Array, known: Array, motion: Array, share: Array | float
) -> jax.Array:
    """The picture mixed with its predecessor, which is first brought into the range around it.

    picture: `(H, W, 3)`. before: the result of the previous frame, read bilinearly where each pixel
    was. known: `(H, W, 1)` boolean, which pixels of that count; the others, such as the sky, are no
    part of this picture. motion: `(H, W, 2)`, pixels to there. share: of the new picture; where
    nothing is known from before, it is taken as it is.
    Returns `(H, W, 3)`.
    """
    place, inside = where_it_was(motion)
    was_there, place = inside[..., None], jnp.where(inside, place, 0)
    read = lambda channel: map_coordinates(channel, list(place), order=1, mode="nearest")
    counted = jnp.concatenate([jnp.where(known, before, 0), known], axis=-1)
    *sums, weight = (read(counted[..., c]) for c in range(4))
    was_there &= weight[..., None] > 0
    history = divide(jnp.stack(sums, axis=-1), weight[..., None])
    colour = jnp.asarray(picture) @ jnp.array(YCOCG).T
    history = jnp.clip(history @ jnp.array(YCOCG).T, *neighbourhood(colour))
    mixed = history + share * (colour - history)
    return jnp.where(was_there, mixed @ jnp.array(RGB).T, picture)


def where_it_was(motion: Array) -> tuple[jax.Array, jax.Array]:
    """Row and column of each pixel in the previous frame, `(2, H, W)`, and whether that lies among
    the pixels' centres, `(H, W)`; NaN does not."""
    y, x = jnp.mgrid[: motion.shape[0], : motion.shape[1]]
    place = jnp.stack([y + motion[..., 1], x + motion[..., 0]])
    last = jnp.array(motion.shape[:2])[:, None, None] - 1
    return place, jnp.all((place >= 0) & (place <= last), axis=0)


def neighbourhood(colour: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Least and largest value around each pixel, each the mean of those of 5 and of 9 pixels."""
    height, width = colour.shape[:2]
    padded = jnp.pad(colour, ((1, 1), (1, 1), (0, 0)), mode="edge")
    take = lambda y, x: padded[1 + y : 1 + y + height, 1 + x : 1 + x + width]
    cross = jnp.stack([take(*at) for at in CROSS])
    corners = jnp.stack([take(*at) for at in CORNERS])
    low, high = cross.min(0), cross.max(0)
    return (
        (low + jnp.minimum(low, corners.min(0))) / 2,
        (high + jnp.maximum(high, corners.max(0))) / 2,
    )
