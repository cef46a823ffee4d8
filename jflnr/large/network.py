"""FLNR piece by piece: the passes of adaptive FLR, and the network on tiles of blocks.

What the network reads of the whole frame are two means of what the regressions find. So tiles are
fitted twice: adaptive FLR's models give those means, and the second time the network uses them.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.flnr import features, regression, unet
from jflnr.flr import adaptive, energy, widths
from jflnr.flr.floor import with_own_light
from jflnr.flr.level import Grid, mean_guides
from jflnr.large.planes import Planes
from jflnr.large.pyramid import REACH, Job
from jflnr.large.steps import Common

# Tiles begin where the coarsest means of light and the coarsest scale of the network do, in blocks.
ALIGN = 32
# Rows of blocks that the means are taken of at a time.
ROWS = 64


class Known(NamedTuple):
    """What the network takes from the whole frame: its mean brightness, whether there is light, how
    much brightness is given back (`energy.rate`), and `features.light_means`, `(2,)`."""

    mean: jax.Array
    lit: bool
    rate: jax.Array
    means: jax.Array


def correct(
    job: Job,
    moments: Planes,
    models: Planes,
    output: np.ndarray,
    mean: jax.Array,
    rate: jax.Array,
    params: unet.Params,
) -> None:
    """Put the network's models in the place of adaptive FLR's, brightness given back.

    output: `(h, w)`, what those give blocks twice as large. mean: brightness of the frame. rate:
    how much brightness is given back.
    """
    scales = sum(name.startswith("encode") and name[-1].isdigit() for name in params)
    # Six blocks of the coarsest scale, each twice the finest, are more than all convolutions reach;
    # before them and after them all levels are fitted.
    reach = 2 * REACH + 6 * 2**scales
    known = Known(mean, bool(output.any()), rate, _means(job, moments, models, mean))
    for across, along in job.tiles(job.block, reach, max(ALIGN, 2**scales)):
        y, x = across.on(2), along.on(2)
        given = jnp.asarray(output[y.outer, x.outer])
        tile = moments[across.outer, along.outer]
        found = np.asarray(_models(tile, given, known, job.common, params, job.block))
        found = found.reshape(-1, *found.shape[2:])
        models[across.inner, along.inner] = found[:, across.kept, along.kept]


def _means(job: Job, moments: Planes, models: Planes, mean: jax.Array) -> jax.Array:
    """`features.light_means` of all blocks, from rows of them."""
    guides, sums = job.common.shift.size, np.zeros(2)
    for top in range(0, models.height, ROWS):
        rows = slice(top, min(top + ROWS, models.height))
        found = models[rows, :].reshape(guides + 2, features.CHANNELS, -1, models.width)[:-1]
        known = jnp.asarray(moments[rows, :][:-1])
        means = features.light_means(features.colour_of(jnp.asarray(found), known, guides), mean)
        sums += np.array([float(value) for value in means]) * found.shape[2]
    return jnp.float32(sums / models.height)


@functools.partial(jax.jit, static_argnames="block")
def _models(
    moments: jax.Array,
    output: jax.Array,
    known: Known,
    common: Common,
    params: unet.Params,
    block: int,
) -> jax.Array:
    """The network's models of the blocks of a tile, `(Q + 2, C, h, w)`."""
    grid = Grid(moments[:-1], moments[-1:], block)
    guides, channels = common.shift.size, features.CHANNELS
    numbers = common.numbers
    _, steps = widths.fit_levels(grid, common.shift, channels, adaptive.LEVELS, known.mean, numbers)
    factor = energy.scale(jnp.ones((1, 1, *moments.shape[1:])), output, known.rate)[0, 0]
    x = features.of_steps(steps, guides, known.mean, tuple(known.means))
    # Without light there is none for the gain to act on, either.
    dark = jnp.where(known.lit, features.DARK * known.mean, 0)
    frame = regression.Prepared(x, grid.moments, grid.noise, factor, known.mean, dark, 1.0)
    models = regression.finish(regression.heard(params, frame), frame, common.shift)
    return with_own_light(models, mean_guides(grid.moments, guides))
