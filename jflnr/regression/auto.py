"""No more model than a place needs: adaptive FLR in two passes, refined where it pays.

Pixels weigh what their block does, so that the moments are collected once, without weights, and
weighed afterwards. The finest models are fitted only in the tiles where the step before them has
brought signal. docs/select.md says what that is worth.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jflnr.checks import one_sentence
from jflnr.frame import Frame
from jflnr.images.inputs import prepare
from jflnr.lazy import jax, jit, jnp, pytree
from jflnr.regression.adaptive import AdaptiveFLR, counted, weight_of
from jflnr.regression.division import divide
from jflnr.regression.level import brightness, mean_guides, predict
from jflnr.regression.moments import channels_of, collect, index_xx, index_xy
from jflnr.regression.multiscale import TILE, fit_levels
from jflnr.regression.resampling import double, halve, halve_inside
from jflnr.stages import Known, Parts, Stage, run


@pytree
@dataclass(frozen=True)
class Auto(AdaptiveFLR):
    """Adaptive FLR that is refined where it pays (docs/select.md); the fields are its."""

    name: ClassVar[str] = "auto"

    worth: jax.Array | float | None = 0.6

    def stages(self) -> tuple[Stage, ...]:
        light, pilot, moments, *rest = super().stages()
        blocks = "blocks", self.side
        light = dataclasses.replace(light, run=collect_blocks, gives=(*light.gives, blocks))
        reads = *moments.reads, "blocks"
        align = 4 * self.side
        moments = dataclasses.replace(
            moments, run=weigh_blocks, reads=reads, pixels=False, reach=2 * align, align=align
        )
        return light, pilot, moments, *rest


@one_sentence()
def signal_in_tiles(
    frame: Frame, method: Auto | None = None, guides: Sequence[str] | None = None
) -> tuple[np.ndarray, int]:
    """How much of what the step before the finest adds to each tile is signal; those above
    `method.worth` are refined.

    frame, guides: as of `denoise`. method: with its options; the default one if None.
    Returns `(ceil(H / side), ceil(W / side))`, in [0, 1], and the tiles' side in pixels.
    """
    method = Auto() if method is None else method
    names, inputs = prepare(frame, guides, method)
    own = method.for_frame(inputs, names)
    return np.asarray(_signal(own, inputs, names)), TILE * own.side


@functools.partial(jit, static_argnames="names")
def _signal(method: AdaptiveFLR, frame: Frame, names: tuple[str, ...]) -> jax.Array:
    images = method.images(frame, names)
    parts, known = run(method.stages()[:3], method, images, method.known(images))
    _, steps = fit_levels(method, parts["moments"], known)
    return halve_inside(steps[-2].share)


def collect_blocks(method: Auto, parts: Parts, known: Known) -> Parts:
    """The one pass over the light: unweighted moments on the finest blocks, and as two more planes
    the mean squares of the brightness and of the weight; and moments of the brightness alone, on
    blocks twice as large."""
    target, guides, shift, unit = parts["target"], parts["guides"], known["shift"], known["unit"]
    weights = brightness(target.shape[-1], unit.dtype) / unit
    planes = collect(target, guides, shift, method.finest, parts["weight"], weights)
    xx = index_xy(0, 0, shift.size, 0)
    blocks = jnp.concatenate([planes[:xx], planes[xx:-2] / unit, planes[-2:]])
    return {"blocks": blocks} | counted(halve(light_moments(blocks, shift.size)), shift.size)


def light_moments(blocks: jax.Array, guides: int) -> jax.Array:
    """Moments of the brightness alone, from those of `collect_blocks`."""
    xx, channels = index_xy(0, 0, guides, 0), channels_of(blocks[:-2], guides)
    cross = blocks[xx:-2].reshape(guides + 1, channels, *blocks.shape[1:])
    light = jnp.einsum("qchw,c->qhw", cross, brightness(channels, blocks.dtype))
    return jnp.concatenate([blocks[:xx], light])


def weigh_blocks(method: Auto, parts: Parts, known: Known) -> Parts:
    """Moments of the blocks by their weights, and one plane of the noise that these leave."""
    blocks, pilot, count = parts["blocks"], parts["pilot"], known["shift"].size
    height, width = blocks.shape[1:]
    pilot = double(double(pilot, -(-height // 2), -(-width // 2)), height, width)
    weights = weight_of(predict(pilot, mean_guides(blocks, count)), known["mean"], method)
    square = squared_residual(light_moments(blocks, count), blocks[-2], pilot[:, 0])
    own = divide(blocks[-1], blocks[0])  # what the pixels weigh already
    return {"moments": jnp.concatenate([blocks[:-2] * weights, (square * own * weights**2)[None]])}


def squared_residual(light: jax.Array, squares: jax.Array, model: jax.Array) -> jax.Array:
    """Mean square of brightness minus model, `(h, w)`, from moments: yy - 2 a.xy + a.xx.a.

    light: moments of the brightness. squares: `(h, w)`. model: `(Q + 1, h, w)`.
    """
    count = model.shape[0]
    pairs = np.array([[index_xx(i, j) for j in range(count)] for i in range(count)])
    cross = light[count * (count + 1) // 2 :]
    fitted = jnp.einsum("ijhw,jhw->ihw", light[pairs], model)
    return jnp.maximum(squares + jnp.sum(model * (fitted - 2 * cross), axis=0), 0)
