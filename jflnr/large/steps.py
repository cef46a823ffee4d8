"""The steps of adaptive FLR on one strip of pixels or one tile of blocks, compiled."""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr import guides as guide_layers
from jflnr.flr import adaptive, energy, widths
from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.apply import apply_rows
from jflnr.flr.floor import with_own_light
from jflnr.flr.level import Grid, mean_guides
from jflnr.flr.moments import Guides
from jflnr.frame import Frame
from jflnr.inputs import adaptive_images

_on_pixels = functools.partial(jax.jit, static_argnames=("names", "block"))
_on_blocks = functools.partial(jax.jit, static_argnames=("channels", "block"))


class Common(NamedTuple):
    """What all parts of a frame share.

    shift: `(Q,)`. unit: what the light is divided by. numbers: the constants themselves.
    """

    scene: guide_layers.Scene
    shift: jax.Array
    unit: jax.Array
    numbers: AdaptiveParameters


@functools.partial(jax.jit, static_argnames="names")
def images_of(
    frame: Frame, names: tuple[str, ...], scene: guide_layers.Scene
) -> tuple[Guides, jax.Array]:
    """The guides and the light of a frame."""
    images = adaptive_images(frame, names, scene)
    return images["guides"], images["target"]


@_on_pixels
def light_of_strip(strip: Frame, common: Common, names: tuple[str, ...], block: int) -> jax.Array:
    """Pass 1: moments of the brightness on blocks twice as large as `block`, `(K, h/2, w/2)`."""
    images = _images(strip, common, names)
    return adaptive.collect_light(
        images["target"], images["guides"], common.shift, images["weight"], block, common.unit
    )


@functools.partial(jax.jit, static_argnames="block")
def pilot_of_tile(light: jax.Array, mean: jax.Array, common: Common, block: int) -> jax.Array:
    """Models of the brightness on blocks four times as large as `block`."""
    return adaptive.fit_pilot(light, mean, common.shift, common.numbers, block)


@_on_pixels
def moments_of_strip(
    strip: Frame, pilot: adaptive.Pilot, common: Common, names: tuple[str, ...], block: int
) -> jax.Array:
    """Pass 2: weighted moments on the finest blocks and their noise, `(K + 1, h, w)`."""
    images = _images(strip, common, names)
    grid = adaptive.collect_grid(
        images["target"],
        images["guides"],
        common.shift,
        pilot,
        images["weight"],
        common.numbers,
        block,
        common.unit,
    )
    return jnp.concatenate([grid.moments, grid.noise])


@_on_blocks
def models_of_tile(
    moments: jax.Array,
    light: jax.Array,
    mean: jax.Array,
    common: Common,
    channels: int,
    block: int,
) -> tuple[jax.Array, jax.Array]:
    """Models of the finest blocks `(Q + 2, C, h, w)`, the last row from `floor.with_own_light`, and
    the brightness `(h/2, w/2)` they give."""
    grid = Grid(moments[:-1], moments[-1:], block)
    guides = common.shift.size
    levels = adaptive.LEVELS
    models = widths.merged_models(
        *widths.fit_levels(grid, common.shift, channels, levels, mean, common.numbers)
    )
    output = energy.block_light(models, light, guides)
    return with_own_light(models, mean_guides(grid.moments, guides)), output


@_on_pixels
def image_of_strip(
    strip: Frame, models: jax.Array, common: Common, names: tuple[str, ...], block: int
) -> jax.Array:
    """Pass 3: the denoised light `(H, W, C)`. models: `(Q + 2, C, h + 2, w)`."""
    guides = _images(strip, common, names)["guides"]
    return common.unit * apply_rows(models, guides, common.shift, block, common.numbers.floor)


def _images(strip: Frame, common: Common, names: tuple[str, ...]) -> dict:
    """The strip's images without the rows above and below."""
    images = adaptive_images(strip, names, common.scene)
    return jax.tree.map(lambda a: a[1:-1], images)
