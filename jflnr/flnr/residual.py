"""Light that the merged models miss, gathered from the samples under windows that were learned.

The models explain light by guides. What the samples say beyond that (a shadow that no guide
shows) is averaged once more per block: over windows that end where the network sees a border, from
blocks that it trusts.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jflnr.flr.level import brightness
from jflnr.flr.pyramid import double, halve
from jflnr.flr.window import gather, window_over

# Grids, fine to coarse, on which residuals are gathered.
LEVELS = 3
# Of the window without the network: sigma in blocks, and what guides and light may differ by.
SIGMA, SCALE = 2.0, 2.0
# Outputs of the network per block and grid, before the features that it adds to the window's.
CONTROLS = 3


def add_residual(
    models: jax.Array, sums: jax.Array, controls: list[jax.Array], mean: jax.Array
) -> jax.Array:
    """Add to the constants of the models what the samples have beyond them.

    models: `(Q + 1, C, h, w)`. sums: `(Q + 1 + C, h, w)`, over each block, of a pixel's weight
    times [1, X - shift, Y]. controls: per grid, fine to coarse, `(CONTROLS + Q + 1, h', w')`:
    share of the residual, logarithm of the window's width, trust in a block, and features.
    mean: brightness of the frame. With shares of 0 nothing is added.
    """
    count = models.shape[0]
    n = sums[:1]
    means = sums[:count] * jnp.where(n > 1e-12, 1 / jnp.where(n > 1e-12, n, 1), 0)
    means = means.at[0].set(1)
    light = jnp.einsum("qchw,qhw->chw", models, means)
    dark = jnp.einsum("chw,c->hw", light, brightness(light.shape[0], light.dtype))
    edge = jnp.log(jnp.maximum(dark, 0) / mean + 0.1)[None]
    alike = SCALE * jnp.concatenate([means[1:], edge])
    residual, added = sums[count:] - n * light, jnp.zeros_like(light)
    for level in reversed(range(LEVELS)):
        more = _gathered(n, residual, alike, controls[level], level)
        added, residual = added + more, residual - n * more
    return models.at[0].add(added)


def _gathered(
    n: jax.Array, residual: jax.Array, alike: jax.Array, control: jax.Array, level: int
) -> jax.Array:
    """Mean residual under the window of one grid, times its share: `(C, h, w)`."""
    planes, sizes = jnp.concatenate([n, residual, n * alike]), []
    for _ in range(level):
        sizes.append(planes.shape[1:])
        planes = halve(planes)
    channels = residual.shape[0]
    n, residual, alike = planes[:1], planes[1 : 1 + channels], planes[1 + channels :]
    least = 1e-3 * jnp.mean(n) + 1e-12
    features = alike / (n + least) + control[CONTROLS:]
    window = window_over(features, SIGMA * jnp.exp(jnp.tanh(control[1])))
    trust = 2 * jax.nn.sigmoid(control[2])
    gathered = gather(jnp.concatenate([n, residual]) * trust, window)
    more = jnp.tanh(control[0]) * gathered[1:] / (gathered[:1] + least)
    for height, width in reversed(sizes):
        more = double(more, height, width)
    return more
