"""Where each pixel was in the previous frame, and what an image held there (BMFR, section 3.2).

Motion vectors say where. Of the four pixels around that place only those count that show the same
surface; their bilinear weights are divided by their sum. Where none is left the pixel is
disoccluded: it was hidden, or outside the picture.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks
from jflnr.frame import Array, Frame
from jflnr.regression.division import divide

# A tap may be off the pixel's tangent plane by this share of the depth. Positions that are stored
# as half use up to a quarter of it.
OFF_PLANE = 0.01
# Least cosine between the normals of two pixels of one surface, and most, of normals that may be
# twice too long; what is beyond is no normal.
SAME_NORMAL, COSINE = 0.8, 4.0


class Surface(NamedTuple):
    """What tells surfaces apart.

    normal: `(H, W, 3)`, unit. depth: `(H, W, 1)`, along the view axis in scene units, 0 where
    nothing is hit. position: `(H, W, 3)`, in world space, scene units; where it is None depths are
    compared instead.
    """

    normal: Array
    depth: Array
    position: Array | None = None

    @classmethod
    def of(cls, frame: Frame) -> Surface:
        """Those that a frame shows. Raises `ValueError` if it lacks a normal or a depth."""
        checks.image("normal", frame.normal, 3)
        checks.image("depth", frame.depth, 1)
        if frame.position is not None:
            checks.image("position", frame.position, 3)
        return cls(frame.normal, frame.depth, frame.position)


class Taps(NamedTuple):
    """The four pixels of the previous frame that make up each pixel.

    pixel: `(H, W, 4)`, whole numbers, counted row by row. weight: `(H, W, 4)`, 0 for a tap that is
    not accepted; their sum is 1, or 0 where the pixel is disoccluded.
    """

    pixel: jax.Array
    weight: jax.Array

    @property
    def seen(self) -> jax.Array:
        """Whether the previous frame showed this place, `(H, W, 1)`, boolean."""
        return jnp.any(self.weight > 0, axis=-1, keepdims=True)


def find_taps(
    motion: Array, here: Surface, before: Surface, *, off_plane: float = OFF_PLANE
) -> Taps:
    """The taps of every pixel.

    A tap is accepted if it lies near the pixel's tangent plane, its normal is alike, and both hit
    something. The distance from the plane counts, not from the point: on a floor seen at a flat
    angle neighbouring pixels are far apart. It may be `off_plane` times the depth, and as much more
    as the pixel moved across the picture, since a point that moves by itself leaves its plane.

    motion: `(H, W, 2)`, pixels (x, y) from here to where this point was in the previous frame; NaN
    where that is unknown. here, before: the surfaces of both frames. off_plane: a share of the
    depth.
    """
    height, width = motion.shape[:2]
    known = jnp.all(jnp.isfinite(motion), axis=-1)
    motion = jnp.where(known[..., None], jnp.asarray(motion), 0)
    # Far outside there is nothing, and no whole number for it.
    x = jnp.clip(jnp.arange(width) + motion[..., 0], -2, width + 1)
    y = jnp.clip(jnp.arange(height)[:, None] + motion[..., 1], -2, height + 1)
    left, top = jnp.floor(x), jnp.floor(y)
    # A pixel is about depth / W wide.
    moved = jnp.max(jnp.abs(motion), axis=-1) / width
    tolerance = (off_plane + moved) * here.depth[..., 0]

    def tap(dx: int, dy: int) -> tuple[jax.Array, jax.Array]:
        column, row = left + dx, top + dy
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        pixel = jnp.where(inside, row * width + column, 0).astype(jnp.int32)
        there = jax.tree.map(lambda image: _take(image, pixel), before)
        accepted = known & inside & _alike(here, there, tolerance)
        share = (1 - jnp.abs(x - column)) * (1 - jnp.abs(y - row))
        return pixel, jnp.where(accepted, share, 0)

    pixel, weight = zip(*(tap(dx, dy) for dy in (0, 1) for dx in (0, 1)), strict=True)
    pixels, weights = jnp.stack(pixel, axis=-1), jnp.stack(weight, axis=-1)
    return Taps(pixels, divide(weights, jnp.sum(weights, axis=-1, keepdims=True)))


def gather(taps: Taps, image: Array) -> jax.Array:
    """What an image of the previous frame held at each pixel's place.

    Linear in the image. image: `(H, W, C)`; where its values are not finite and count, so is the
    result. Returns `(H, W, C)`, 0 where the pixel is disoccluded.
    """
    total = jnp.zeros((*taps.pixel.shape[:2], image.shape[-1]))
    for pixel, share in zip(*(jnp.moveaxis(a, -1, 0) for a in taps), strict=True):
        total += jnp.where((share > 0)[..., None], share[..., None] * _take(image, pixel), 0)
    return total


def own_turn(taps: Taps, here: Surface, before: Surface) -> jax.Array:
    """How far each pixel's surface has turned by itself since the previous frame, `(H, W, 1)`.

    The squared length of its normal's change: radians squared where that is small. None of it
    counts where the point stayed within half a pixel's width in space, as under a camera alone, and
    all where it went one; without positions, all everywhere.
    """

    def change(now: Array, then: Array) -> jax.Array:
        return jnp.sum((jnp.asarray(now) - gather(taps, then)) ** 2, axis=-1, keepdims=True)

    turn = change(here.normal, before.normal)
    if here.position is not None and before.position is not None:
        pixel = jnp.asarray(here.depth) / here.depth.shape[1]
        moved = divide(change(here.position, before.position), pixel**2)
        turn *= jnp.clip(4 * moved - 1, 0, 3) / 3
    # Unit vectors are no farther apart; what says it is a normal may be any number.
    return jnp.where(taps.seen & jnp.isfinite(turn), jnp.minimum(turn, 4), 0)


def _take(image: Array, pixel: jax.Array) -> jax.Array:
    return jnp.asarray(image).reshape(-1, image.shape[-1])[pixel]


def _alike(here: Surface, there: Surface, tolerance: jax.Array) -> jax.Array:
    """Whether both show one surface, `(H, W)`. tolerance: `(H, W)`, in scene units."""
    if here.position is None or there.position is None:
        apart = (there.depth - here.depth)[..., 0]
    else:
        apart = jnp.sum(here.normal * (there.position - here.position), axis=-1)
    cosine = jnp.sum(here.normal * there.normal, axis=-1)
    turned = (cosine < SAME_NORMAL) | (cosine > COSINE)
    hit = (here.depth > 0) & (there.depth > 0)
    return (jnp.abs(apart) <= tolerance) & ~turned & hit[..., 0]
