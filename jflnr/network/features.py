"""What the network reads: planes on blocks, free of units.

Light is divided by the frame's mean before its logarithm is taken, so what is read does not change
with the scale of the light, and depth comes divided by its median.
"""

from __future__ import annotations

import numpy as np

from jflnr.lazy import jax, jnp
from jflnr.network import unet
from jflnr.regression.level import Grid, brightness, mean_guides, predict
from jflnr.regression.moments import index_xx, index_xy
from jflnr.regression.pyramid import double, halve
from jflnr.regression.widths import Step

# The guides that the features are made of: normal (3), depth, ambient occlusion.
GUIDES = ("normal", "depth", "ao")
CHANNELS = 3
# Light below this share of the frame's mean is as good as dark.
DARK = 0.03
# Guides that vary by more inside a block are beyond all that the network has seen.
MOST_SPREAD = 9.0
BLURS = 4
OF_GRID, OF_STEP = 6, 6
COUNT = 4 * (OF_GRID + OF_STEP + CHANNELS) + 2 * OF_STEP + BLURS + 2


def of_steps(steps: list[Step], guides: int, mean: jax.Array) -> jax.Array:
    """What is read of blocks twice as large as the finest: `(COUNT - 2, h, w)`.

    The finest blocks lie side by side as channels. steps: coarse to fine. mean: of the frame.
    """
    last = steps[-1]
    colour = colour_of(last.merged, last.grid.moments, guides)
    light = log_light(_brightness(colour), mean)
    finest = [
        of_grid(last.grid, guides, mean),
        of_step(last, mean),
        log_light(colour, mean) - light,
    ]
    packed = unet.pack(jnp.concatenate(finest))
    size = packed.shape[:2]
    coarser = [double(of_step(steps[0], mean), *size), of_step(steps[1], mean)]
    planes = [*coarser, blurred_light(last.grid, guides, mean)]
    return jnp.concatenate([jnp.moveaxis(packed, -1, 0), *planes])


def with_means(read: jax.Array, means: jax.Array, mean: jax.Array) -> jax.Array:
    """All that is read: `of_steps` and what is the same everywhere, `(h, w, COUNT)`.

    means: of the frame's `light_planes`, brightness and its logarithm.
    """
    whole = jnp.stack([jnp.log(means[0] / mean + 0.1), means[1]])
    whole = jnp.broadcast_to(whole[:, None, None], (2, *read.shape[1:]))
    return jnp.moveaxis(jnp.concatenate([read, whole]), 0, -1)


def colour_of(models: jax.Array, moments: jax.Array, guides: int) -> jax.Array:
    """The light that models `(Q + 1, C, h, w)` give their blocks, `(C, h, w)`."""
    return jnp.einsum("qchw,qhw->chw", models, mean_guides(moments, guides))


def light_planes(colour: jax.Array, mean: jax.Array) -> jax.Array:
    """Of every block its brightness, the logarithm of that, and 1: `(3, h, w)`.

    colour: `(C, h, w)`.
    """
    light = _brightness(jnp.maximum(colour, 0))
    return jnp.stack([light, log_light(_brightness(colour), mean), jnp.ones_like(light)])


def log_light(light: jax.Array, mean: jax.Array) -> jax.Array:
    """Logarithm of light relative to the frame's mean, near 0 on average."""
    return jnp.log(jnp.maximum(light, 0) / mean + DARK)


def of_grid(grid: Grid, guides: int, mean: jax.Array) -> jax.Array:
    """What blocks know before any fit: how guides vary, light and its noise. `(OF_GRID, h, w)`.

    The guides' own values are left out: with them the network learns the training scenes by heart.
    """
    n = grid.moments[0]
    inverse = jnp.where(n > 1e-12, 1 / jnp.where(n > 1e-12, n, 1), 0)
    centred = mean_guides(grid.moments, guides)[1:]
    diagonal = np.array([index_xx(i + 1, i + 1) for i in range(guides)])
    variance = jnp.maximum(grid.moments[diagonal] * inverse - centred**2, 0)
    spread = jnp.stack([jnp.sum(variance[:3], axis=0), variance[3], variance[4]])
    light = _light(grid.moments, guides) * inverse
    noise = jnp.sqrt(grid.noise[0] + 1e-12 * mean**2) * inverse
    own = [jnp.log(n + 0.01), log_light(light, mean), log_light(noise, mean)]
    spread = jnp.minimum(spread, MOST_SPREAD)
    return jnp.concatenate([4 * jnp.sqrt(spread + 1e-4), jnp.stack(own)])


def of_step(step: Step, mean: jax.Array) -> jax.Array:
    """What one level's fit found, beside the coarser one: `(OF_STEP, h, w)`."""
    regressors = mean_guides(step.grid.moments, step.fine.coefficients.shape[0] - 1)
    reference = step.level**2 + 0.01 * mean**2
    return jnp.stack(
        [
            log_light(step.level, mean),
            log_light(predict(step.fine.coefficients, regressors), mean),
            log_light(predict(step.coarse.coefficients, regressors), mean),
            jnp.log(step.fine.variance / reference + 1e-3) / 2,
            jnp.log(step.coarse.variance / reference + 1e-3) / 2,
            step.share,
        ]
    )


def blurred_light(grid: Grid, guides: int, mean: jax.Array) -> jax.Array:
    """The light averaged over ever wider windows, on the grid half as fine: `(BLURS, h, w)`."""
    planes = halve(jnp.stack([grid.moments[0], _light(grid.moments, guides)]))
    sizes, found = [planes.shape[1:]], []
    for _ in range(BLURS):
        n, light = _tent(planes)
        light = (light / jnp.maximum(n, 1e-9))[None]
        for height, width in reversed(sizes[:-1]):
            light = double(light, height, width)
        found.append(log_light(light, mean))
        planes = halve(planes)
        sizes.append(planes.shape[1:])
    return jnp.concatenate(found)


def _brightness(colour: jax.Array) -> jax.Array:
    return jnp.einsum("chw,c->hw", colour, brightness(CHANNELS, colour.dtype))


def _light(moments: jax.Array, guides: int) -> jax.Array:
    start = index_xy(0, 0, guides, CHANNELS)
    return _brightness(moments[start : start + CHANNELS])


def _tent(planes: jax.Array) -> jax.Array:
    """Weights 1, 2, 1 along rows and columns, zeros beyond the border."""
    for axis in (1, 2):
        margin = [(1, 1) if a == axis else (0, 0) for a in range(3)]
        padded = jnp.pad(planes, margin)
        size = planes.shape[axis]
        before = jax.lax.slice_in_dim(padded, 0, size, axis=axis)
        after = jax.lax.slice_in_dim(padded, 2, size + 2, axis=axis)
        planes = (before + 2 * planes + after) / 4
    return planes
