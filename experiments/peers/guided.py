"""The guided filter for global illumination (Bauszat et al. 2011) and its fast form.

He, Sun, Tang, "Guided image filtering" (2010) with several guide channels, box windows and blurred
models; He and Sun, "Fast guided filter" (2015) solves at a lower resolution. Bauszat et al. guide
it by normals and depth, with radius 24 and eps 0.01.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from experiments.peers.windows import box
from jflnr.regression.solve import cholesky_solve
from jflnr.frame import Array, Frame
from jflnr.guides import layers, shrink

PAPER: dict[str, Any] = {"guides": ("normal", "depth"), "radius": 24, "eps": 0.01}
FAST_PAPER: dict[str, Any] = PAPER | {"subsample": 4, "average": False}
TUNED: dict[str, Any] = {"guides": ("normal", "depth"), "radius": 16, "eps": 0.01}
FAST_TUNED: dict[str, Any] = TUNED | {
    "guides": ("normal", "depth", "ao"),
    "subsample": 4,
    "average": True,
}


def denoise(
    frame: Frame,
    *,
    guides: tuple[str, ...],
    radius: int,
    eps: float,
    subsample: int = 1,
    average: bool = True,
) -> Array:
    """Guided filter; the fast one if subsample > 1. Pixels outside the mask do not count.

    radius: of the box window, pixels. eps: added to the variance of each guide. subsample: how many
    times smaller the inputs are made, by averaging or else by taking every n-th pixel.
    Returns `(H, W, 3)`.
    """
    return _denoise(frame, guides, radius, eps, subsample, average)


@functools.partial(jax.jit, static_argnames=("guides", "radius", "subsample", "average"))
def _denoise(
    frame: Frame,
    guides: tuple[str, ...],
    radius: int,
    eps: float,
    subsample: int,
    average: bool,
) -> jax.Array:
    x = jnp.concatenate(layers(frame, guides), axis=-1)
    x = x - jnp.mean(x, axis=(0, 1))  # changes nothing but the rounding error
    y = jnp.asarray(frame.indirect)
    mask = jnp.ones_like(y[..., :1]) if frame.mask is None else jnp.asarray(frame.mask)
    small_x, small_y, weight = x, y, mask
    if subsample > 1 and average:
        small_x, small_y = shrink(x, subsample, mask), shrink(y, subsample, mask)
        weight = shrink(mask, subsample)
    elif subsample > 1:
        small_x, small_y, weight = (image[::subsample, ::subsample] for image in (x, y, mask))
    slopes, offset = models(small_x, small_y, weight, max(round(radius / subsample), 1), eps)
    if subsample > 1:
        slopes, offset = (enlarge(model, subsample, x.shape) for model in (slopes, offset))
    return evaluate(slopes, offset, x)


def models(
    x: jax.Array, y: jax.Array, weight: jax.Array, radius: int, eps: float
) -> tuple[jax.Array, jax.Array]:
    """Blurred affine models: slopes `(H, W, Q * 3)` and offset `(H, W, 3)`."""
    height, width, count = x.shape
    pairs = (x[..., :, None] * x[..., None, :]).reshape(height, width, -1)
    cross = (x[..., :, None] * y[..., None, :]).reshape(height, width, -1)
    parts = [weight, weight * x, weight * y, weight * pairs, weight * cross]
    sums = box(jnp.concatenate(parts, axis=-1), radius)
    means = sums[..., 1:] / jnp.maximum(sums[..., :1], 1e-6)
    mean_x, mean_y, xx, xy = jnp.split(means, [count, count + 3, count + 3 + count**2], axis=-1)

    mean_x, mean_y = (jnp.moveaxis(mean, -1, 0) for mean in (mean_x, mean_y))
    covariance = jnp.moveaxis(xx, -1, 0).reshape(count, count, height, width)
    covariance = covariance - mean_x[:, None] * mean_x + eps * jnp.eye(count)[:, :, None, None]
    right = jnp.moveaxis(xy, -1, 0).reshape(count, 3, height, width) - mean_x[:, None] * mean_y
    slopes = cholesky_solve(covariance, right)
    offset = mean_y - jnp.sum(slopes * mean_x[:, None], axis=0)

    model = jnp.concatenate([slopes.reshape(-1, height, width), offset])
    blurred = box(jnp.moveaxis(model, 0, -1), radius)
    blurred = blurred / box(jnp.ones((height, width, 1)), radius)
    return blurred[..., : 3 * count], blurred[..., 3 * count :]


def enlarge(image: jax.Array, factor: int, shape: tuple[int, ...]) -> jax.Array:
    """Bilinear, cropped to `shape`."""
    size = (image.shape[0] * factor, image.shape[1] * factor, image.shape[2])
    return jax.image.resize(image, size, "linear")[: shape[0], : shape[1]]


def evaluate(slopes: jax.Array, offset: jax.Array, x: jax.Array) -> jax.Array:
    """The models at every pixel's guides `(H, W, Q)`."""
    return offset + jnp.einsum("hwqc,hwq->hwc", slopes.reshape(*x.shape, 3), x)
