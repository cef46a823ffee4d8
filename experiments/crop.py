"""A crop of a frame that does not fit in memory, denoised by itself, against the frame in pieces.

Of the whole frame it is given what concerns all of it: the median depth, the point that guides are
measured from, the mean brightness, and how much brightness adaptive FLR gives back. That last
number is the one under which the two agree best; all others are taken from the file.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.denoising import Part, denoise_flr, support_of
from jflnr.regression import adaptive, energy, widths
from jflnr.regression.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.regression.apply import apply, with_borders
from jflnr.regression.floor import with_own_light
from jflnr.regression.level import mean_guides
from jflnr.regression.parameters import DEFAULT
from jflnr.frame import Frame
from jflnr.inputs import adaptive_images, flr_images
from jflnr.large.scanlines import Scanlines
from jflnr.large.source import Rows, scene_of, shift_of

NAMES = ("normal", "depth", "ao")
LAYERS = {*NAMES, "indirect", "mask"}
BLOCK = 8
# Pixels on a side that are compared, and on all sides of them that the windows may reach.
SIDE, MARGIN = 256, 1024
# Rows that are read at a time.
BAND = 64


def difference(source: Path, output: Path, method: str, corner: tuple[int, int]) -> dict[str, Any]:
    """How far `output`, in pieces, is from a crop of `source` that is denoised whole.

    corner: row and column, multiples of 64, in the middle of what is compared.
    Returns the difference in the norm, relative, and the largest of a channel, of the mean.
    """
    rows = Scanlines(source, 1, {}).rows(LAYERS)
    low, start = [_around(place, MARGIN) for place in corner], SIDE // 2
    frame = _cut(rows, low)
    inner = tuple(
        slice(place - start - first, place + start - first)
        for place, first in zip(corner, low, strict=True)
    )
    light = _light(output, corner)
    crop = functools.partial({"flr": _flr, "flr-adaptive": _adaptive}[method], rows, frame)
    ours = crop(inner, light)
    norm = float(np.linalg.norm(ours - light) / np.linalg.norm(ours))
    return {"difference": norm, "largest": float(np.abs(ours - light).max() / ours.mean())}


def _around(place: int, reach: int) -> int:
    return max(place - SIDE // 2 - reach, 0)


def _cut(rows: Rows, low: list[int]) -> Frame:
    """Rows and columns from `low` on, with a margin all around."""
    top, left = low
    bottom, right = (first + SIDE + 2 * MARGIN for first in low)
    bottom = min(bottom, rows.height)
    bands = [
        jax.tree.map(lambda a: a[:, left:right], rows.read(row, min(row + BAND, bottom)))
        for row in range(top, bottom, BAND)
    ]
    return jax.tree.map(lambda *parts: np.concatenate(parts), *bands)


def _light(output: Path, corner: tuple[int, int]) -> np.ndarray:
    """What was written around `corner`, `(SIDE, SIDE, 3)`."""
    top, left = (place - SIDE // 2 for place in corner)
    file = Scanlines(output, 1, {"indirect": "indirect"})
    channels = file.part(top, top + SIDE, {"indirect"}).channels
    return np.stack([channels[f"indirect.{c}"][:, left : left + SIDE] for c in "RGB"], axis=-1)


def _flr(rows: Rows, frame: Frame, inner: tuple[slice, ...], light: np.ndarray) -> np.ndarray:
    scene = scene_of(rows)

    def images(frame: Frame) -> tuple[Any, Any]:
        found = flr_images(frame, NAMES, scene)
        return found["guides"], found["weight"]

    part = Part(support_of(DEFAULT, max(rows.height, rows.width)), scene, shift_of(rows, images))
    return np.asarray(denoise_flr(frame, DEFAULT, NAMES, BLOCK, "jax", part))[inner]


def _adaptive(rows: Rows, frame: Frame, inner: tuple[slice, ...], light: np.ndarray) -> np.ndarray:
    scene = scene_of(rows)
    images = jax.jit(lambda frame: adaptive_images(frame, NAMES, scene))
    shift = shift_of(rows, lambda frame: (images(frame)["guides"], None))
    fitted = _fit(images(frame), shift, jnp.float32(_mean(rows)))
    at = lambda rate: np.asarray(_evaluate(fitted, images(frame), shift, rate))[inner]
    plain, rate = at(jnp.float32(0)), jnp.float32(0.01)
    # Nearly linear in the rate.
    for _ in range(3):
        given = at(rate) - plain
        rate *= jnp.float32(((light - plain) * given).sum() / (given**2).sum())
    return at(rate)


def _mean(rows: Rows) -> float:
    """Mean brightness of the pixels that count."""
    total = count = 0.0
    for row in range(0, rows.height, BAND):
        frame = rows.read(row, min(row + BAND, rows.height))
        brightness = np.asarray(adaptive.light_of(jnp.asarray(frame.indirect)), np.float64)
        used = frame.mask[..., 0] > 0 if frame.mask is not None else np.isfinite(brightness)
        total, count = total + float(brightness[used].sum()), count + float(used.sum())
    return total / count


@jax.jit
def _fit(images: dict[str, Any], shift: jax.Array, mean: jax.Array) -> tuple[jax.Array, ...]:
    """As `adaptive.fit_frame`: models, the brightness that they give, mean guides of the blocks."""
    numbers, block, guides = ADAPTIVE_DEFAULT.numbers(), BLOCK // 2, shift.size
    target, x, weight = images["target"], images["guides"], images["weight"]
    moments = adaptive.collect_light(target, x, shift, weight, block)
    models = with_borders(adaptive.fit_pilot(moments, mean, shift, numbers, block))
    pilot = adaptive.Pilot(models, mean)
    grid = adaptive.collect_grid(target, x, shift, pilot, weight, numbers, block)
    levels = widths.fit_levels(grid, shift, target.shape[-1], adaptive.LEVELS, mean, numbers)
    found = widths.merged_models(*levels)
    return found, energy.block_light(found, moments, guides), mean_guides(grid.moments, guides)


@jax.jit
def _evaluate(
    fitted: tuple[jax.Array, ...], images: dict[str, Any], shift: jax.Array, rate: jax.Array
) -> jax.Array:
    models, brightness, guides = fitted
    models = with_own_light(energy.scale(models, brightness, rate), guides)
    floor = ADAPTIVE_DEFAULT.numbers().floor
    return apply(models, images["guides"], shift, BLOCK // 2, floor)
