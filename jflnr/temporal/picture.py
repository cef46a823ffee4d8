"""The history of whole pictures: denoised ones averaged over time, where they say the same.

What gloss, mirrors and glass show moves otherwise than their surface, and an edge is a mixture of
surfaces: no motion tells where all of a picture was. So every frame is denoised by itself, and the
average of those before it, moved with the surfaces, counts the less, the more it differs from this
one than the errors expected of both explain. Pictures are compared by their square roots, since
errors grow with the light.
"""

from __future__ import annotations

import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.frame import Array, Frame
from jflnr.images.guides import mean_light
from jflnr.regression.adaptive import light_of
from jflnr.regression.division import divide
from jflnr.regression.features import combine

# Least share of a new frame. Pixels on each side over which differences and errors are compared.
LEAST, AROUND = 0.05, 2
# How much of a difference that the errors may explain they are taken to: what changes a little is
# followed rather than averaged.
EXPLAINED = 0.5
# Light that is added before a slope is taken, and the least variance, in means of the picture.
DARK, LEAST_NOISE = 0.1, 1e-9
# No light that is moved and no variance is larger, so that sums are finite.
MOST = 1e37


class Past(NamedTuple):
    """What one frame leaves to the next. picture: `(H, W, C)`, averaged over time. certainty:
    `(H, W, 1)`, one over the variance of its square root; 0 where nothing is known."""

    picture: Array
    certainty: Array


def nothing(frame: Frame) -> Past:
    """Before the first frame."""
    *size, channels = shape_of(frame)
    return Past(jnp.zeros((*size, channels)), jnp.zeros((*size, 1)))


def shape_of(frame: Frame) -> tuple[int, ...]:
    """That of the frame's picture, RGB or RGBA."""
    height, width, channels = frame.indirect.shape
    return height, width, channels + (frame.alpha is not None)


def follow(past: Past, picture: Array, error: Array, motion: Array) -> Past:
    """The average with one more frame in it, which is that frame's picture.

    picture: `(H, W, C)`, denoised, RGB or RGBA; pixels that are not finite stay so. error:
    `(H, W, 1)`, of its brightness. motion: `(H, W, 2)`, as of `Frame`.
    """
    usable = jnp.all(jnp.isfinite(picture), axis=-1, keepdims=True) & jnp.isfinite(error)
    shown = jnp.where(usable, jnp.maximum(picture, 0), 0)
    unit = mean_light(shown[..., :3])
    bright = light_of(shown[..., :3])[..., None] + DARK * unit
    slope = divide(error, 2 * jnp.sqrt(bright))
    noise = jnp.minimum(slope**2 + LEAST_NOISE * unit + 1e-30, MOST)
    moved, certainty = moved_to(past, motion)
    seen, old = usable & (certainty > 0), divide(1, certainty)
    difference = (jnp.sqrt(moved) - jnp.sqrt(shown))[..., :3]
    apart = jnp.mean(difference**2, axis=-1, keepdims=True) - EXPLAINED * (old + noise)
    more, count = (
        combine(jnp.where(seen, plane, 0)[..., 0], AROUND, operator.add)[..., None]
        for plane in (apart, jnp.ones_like(old))
    )
    old = jnp.minimum(old + jnp.maximum(more, 0) / jnp.maximum(count, 1), MOST)
    kept = jnp.where(seen, jnp.minimum(noise / (old + noise), 1 - LEAST), 0)
    mean = jnp.where(usable, shown + kept * (moved - shown), picture)
    return Past(mean, usable / ((1 - kept) ** 2 * noise + kept**2 * old))


def moved_to(past: Past, motion: Array) -> Past:
    """The past where its surfaces are now.

    Pictures are resampled by cubic splines (Keys, "Cubic convolution interpolation for digital
    image processing", 1981), or they would blur from frame to frame.
    """
    height, width = motion.shape[:2]
    known = jnp.all(jnp.isfinite(motion), axis=-1)
    motion = jnp.where(known[..., None], motion, 0)
    x, y = jnp.arange(width) + motion[..., 0], jnp.arange(height)[:, None] + motion[..., 1]
    known &= (jnp.abs(2 * x + 1 - width) <= width) & (jnp.abs(2 * y + 1 - height) <= height)
    x, y = (jnp.clip(at, -1, size) for at, size in ((x, width), (y, height)))
    known_of = (past.certainty > 0) & jnp.isfinite(past.picture)
    images = jnp.where(known_of, past.picture, 0), past.certainty
    results = []
    for image, weights, first in zip(images, (cubic, linear), (-1, 0), strict=True):
        rows, columns = (weights(at - jnp.floor(at)) for at in (y, x))
        total = jnp.zeros_like(image)
        for i, down in enumerate(rows):
            for j, right in enumerate(columns):
                row = jnp.clip(jnp.floor(y) + first + i, 0, height - 1).astype(jnp.int32)
                column = jnp.clip(jnp.floor(x) + first + j, 0, width - 1).astype(jnp.int32)
                total += (down * right)[..., None] * image[row, column]
        results.append(jnp.clip(total, 0, MOST))
    picture, certainty = results
    return Past(picture, jnp.where(known[..., None], certainty, 0))


def linear(t: jax.Array) -> tuple[jax.Array, ...]:
    """Weights of the two samples around a place, which lies `t` behind the first."""
    return 1 - t, t


def cubic(t: jax.Array) -> tuple[jax.Array, ...]:
    """Weights of four samples around it, of which it lies `t` behind the second."""
    return (
        ((2 - t) * t - 1) * t / 2,
        ((3 * t - 5) * t * t + 2) / 2,
        ((4 - 3 * t) * t + 1) * t / 2,
        (t - 1) * t * t / 2,
    )
