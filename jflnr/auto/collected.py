"""What a fit needs to know of a frame's pixels: one pass, and parts of what it brings."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.regression.arguments import check_regression
from jflnr.regression.level import brightness, mean_guides
from jflnr.regression.moments import (
    Guides,
    centre,
    channels_of,
    collect,
    index_xx,
    index_xy,
    unit_of,
)


class Collected(NamedTuple):
    """Of every block of a frame; all light is divided by `unit`.

    moments: `(K, h, w)`. squares: `(h, w)`, mean square of the brightness. shift: `(Q,)`. unit: of
    light.
    """

    moments: jax.Array
    squares: jax.Array
    shift: jax.Array
    unit: jax.Array

    @property
    def channels(self) -> int:
        return channels_of(self.moments, self.shift.size)

    def light(self) -> jax.Array:
        """Moments of the brightness alone."""
        count = self.shift.size + 1
        xx = count * (count + 1) // 2
        cross = self.moments[xx:].reshape(count, self.channels, *self.moments.shape[1:])
        weights = brightness(self.channels, self.moments.dtype)
        return jnp.concatenate([self.moments[:xx], jnp.einsum("qchw,c->qhw", cross, weights)])


def collect_frame(
    target: jax.Array, guides: Guides, block: int, weight: jax.Array | None = None
) -> Collected:
    """The one pass: moments of all channels, and the mean square of the brightness.

    target: `(H, W, C)`, noisy radiance, not negative. guides: `(H, W, Q)`, or several arrays.
    block: side in pixels. weight: `(H, W)`, a mask; 0 removes a pixel, as does any value that is
    not finite.
    """
    check_regression(target, guides, None, weight)
    shift = centre(guides)
    unit = unit_of(target)
    channels = target.shape[-1]
    weights = brightness(channels, unit.dtype) / unit
    planes = collect(target, guides, shift, block, weight, weights)
    xx = index_xy(0, 0, shift.size, channels)
    moments = jnp.concatenate([planes[:xx], planes[xx:-1] / unit])
    return Collected(moments, planes[-1], shift, unit)


def inside(coefficients: jax.Array, moments: jax.Array, groups: Sequence[int]) -> jax.Array:
    """Mean square of what each group of guides does inside every block, `(G, h, w)`.

    That is a' cov(x) a with the slopes a of the brightness. coefficients: `(Q + 1, C, h, w)`.
    moments: those of the guides among themselves, `(K, h, w)`. groups: numbers of guides, in order.
    """
    weights = brightness(coefficients.shape[1], coefficients.dtype)
    slopes = jnp.einsum("qchw,c->qhw", coefficients[1:], weights)
    means = mean_guides(moments, slopes.shape[0])[1:]
    each = 1 / jnp.maximum(moments[0], 1e-12)
    found = [jnp.zeros_like(moments[0]) for _ in groups]
    for group, (end, size) in enumerate(zip(np.cumsum(groups), groups, strict=True)):
        for i, j in np.ndindex(size, size):
            a, b = end - size + i, end - size + j
            covariance = moments[index_xx(a + 1, b + 1)] * each - means[a] * means[b]
            found[group] += slopes[a] * slopes[b] * covariance
    return jnp.maximum(jnp.stack(found), 0) if found else jnp.zeros((0, *moments.shape[1:]))


def hold(coefficients: jax.Array, means: jax.Array, used: Sequence[int]) -> jax.Array:
    """The models with every other guide held at its block's mean: those of the guides `used`.

    coefficients: `(Q + 1, C, h, w)`. means: `(Q + 1, h, w)`, of the guides of each block.
    Returns `(U + 1, C, h, w)`.
    """
    held = [q + 1 for q in range(coefficients.shape[0] - 1) if q not in used]
    value = coefficients[0]
    for q in held:
        value = value + coefficients[q] * means[q]
    return jnp.concatenate([value[None], coefficients[np.array(used, int) + 1]])
