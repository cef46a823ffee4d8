"""Averages over time that know how many samples they hold (BMFR, section 3.2).

At first every frame counts alike; once a new one would count less than a given least share, it
counts that much, so that what is old fades away.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.frame import Array
from jflnr.regression.division import divide
from jflnr.temporal.reproject import Taps, gather


class Average(NamedTuple):
    """An image averaged over frames.

    mean: `(H, W, C)`. samples: `(H, W, 1)`, how many independent frames have a mean of the same
    variance; 0 where nothing is known, and the mean is 0.
    """

    mean: jax.Array
    samples: jax.Array


def nothing(height: int, width: int, channels: int) -> Average:
    """Before the first frame."""
    return Average(jnp.zeros((height, width, channels)), jnp.zeros((height, width, 1)))


def reproject(average: Average, taps: Taps) -> Average:
    """An average of the previous frame, where its pixels are now.

    A pixel is as good as its taps on average: they are neighbours, whose noise is independent in
    the first frame, but who share more and more of it as they are mixed again and again.
    """
    return Average(*(gather(taps, image) for image in average))


def less_sure(average: Average, noise: Array) -> Average:
    """An average that takes on `noise`, `(H, W, 1)`, in variances of one frame."""
    mean, n = average
    return Average(mean, n / (1 + noise * n))


def accumulate(before: Average, image: Array, least: Array | float) -> Average:
    """The average with one more frame in it.

    The new frame counts 1 / (n + 1) after n frames, the share of least variance, but no less than
    `least`; n follows the variance: with a share a, 1/n' = (1 - a)^2 / n + a^2. So it never grows
    beyond (2 - a) / a, 9 for a least share of 0.2.

    before: in this frame's pixels. image: `(H, W, C)`; a pixel that is not finite changes nothing.
    least: between 0 and 1, a number or `(H, W, 1)`.
    """
    mean, n = before
    good = jnp.all(jnp.isfinite(image), axis=-1, keepdims=True)
    share = jnp.maximum(1 / (n + 1), least)
    kept = divide((1 - share) ** 2, n)
    samples = 1 / (kept + share**2)
    mixed = mean + share * (jnp.where(good, image, 0) - mean)
    return Average(jnp.where(good, mixed, mean), jnp.where(good, samples, n))
