"""FLNR piece by piece: the passes of adaptive FLR, and the network on tiles of blocks.

What the network reads of the whole frame are two means of what the regressions find. So adaptive
FLR's models come first, of all tiles, and give those means. Then the tiles are fitted once more and
the network says what it makes of them, and a third time, as it says.
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
    known = Known(mean, bool(output.any()), rate, _means(job, moments, models, mean))
    with job.planes(regression.PLANES, job.block) as says:
        # Six blocks of the coarsest scale, each twice the finest, are more than all convolutions
        # reach.
        for across, along in job.tiles(job.block, REACH + 6 * 2**scales, max(ALIGN, 2**scales)):
            tile = moments[across.outer, along.outer]
            found = np.asarray(_said(tile, known, job.common, params, job.block))
            says[across.inner, along.inner] = found[:, across.kept, along.kept]
        for across, along in job.tiles(job.block, REACH, ALIGN):
            y, x = across.on(2), along.on(2)
            given = jnp.asarray(output[y.outer, x.outer])
            tile, said = (planes[across.outer, along.outer] for planes in (moments, says))
            found = np.asarray(_models(tile, said, given, known, job.common, job.block))
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
def _said(
    moments: jax.Array, known: Known, common: Common, params: unet.Params, block: int
) -> jax.Array:
    """What the network says of the blocks of a tile, `(regression.PLANES, h, w)`."""
    grid = Grid(moments[:-1], moments[-1:], block)
    _, steps = widths.fit_levels(
        grid, common.shift, features.CHANNELS, adaptive.LEVELS, known.mean, common.numbers
    )
    x = features.of_steps(steps, common.shift.size, known.mean, tuple(known.means))
    height, width = moments.shape[1:]
    return jnp.concatenate(regression.heard(params, x, (height, width)))


@functools.partial(jax.jit, static_argnames="block")
def _models(
    moments: jax.Array,
    said: jax.Array,
    output: jax.Array,
    known: Known,
    common: Common,
    block: int,
) -> jax.Array:
    """The models of the blocks of a tile as the network says, `(Q + 2, C, h, w)`."""
    grid = Grid(moments[:-1], moments[-1:], block)
    factor = energy.scale(jnp.ones((1, 1, *moments.shape[1:])), output, known.rate)[0, 0]
    # Without light there is none for the gain to act on, either.
    dark = jnp.where(known.lit, features.DARK * known.mean, 0)
    says = regression.Heard(*jnp.split(said, regression.ENDS))
    steered = regression.Steered(grid.moments, grid.noise, factor, known.mean, dark)
    models = regression.finish(says, steered, common.shift)
    return with_own_light(models, mean_guides(grid.moments, common.shift.size))
