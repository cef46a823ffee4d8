"""A crop of a frame that does not fit in memory, denoised by itself, against the frame in pieces.

Of the whole frame it is given what concerns all of it: the median depth, the point that guides are
measured from, the mean brightness, and how much brightness adaptive FLR gives back. That last
number is the one under which the two agree best; all others are taken from the file.
"""

from __future__ import annotations

import dataclasses
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.frame import Frame
from jflnr.large.scanlines import Scanlines
from jflnr.large.source import Rows, scene_of
from jflnr.large.tiled import Job, sparse_images
from jflnr.methods import method_of
from jflnr.regression.adaptive import light_of
from jflnr.stages import run

NAMES = ("normal", "depth", "ao")
LAYERS = {*NAMES, "indirect", "mask"}
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
    inner = tuple(
        slice(place - start - first, place + start - first)
        for place, first in zip(corner, low, strict=True)
    )
    light = _light(output, corner)
    ours = _denoised(rows, _cut(rows, low), method, inner, light)
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


def _denoised(
    rows: Rows, frame: Frame, name: str, inner: tuple[slice, ...], light: np.ndarray
) -> np.ndarray:
    """`inner` of the frame, under the rate of brightness given back that comes nearest `light`."""
    scene, method = scene_of(rows), method_of(name).for_frame(rows.shapes(), NAMES)
    known = method.known(sparse_images(Job(rows, method, NAMES, scene, 0, None, ExitStack())))
    images = method.images(frame, NAMES, scene)
    # Nothing is learned from the crop.
    *stages, last = [dataclasses.replace(stage, learn=None) for stage in method.stages()]
    if name != "flr":
        known |= {"mean": jnp.float32(_mean(rows)) / known["unit"]}
    parts, _ = jax.jit(lambda images, known: run(stages, method, images, known))(images, known)
    evaluate = jax.jit(lambda parts, known: last.run(method, parts, known)["image"])
    at = lambda rate: np.asarray(evaluate(parts, known | {"rate": rate}))[inner]
    if name == "flr":
        return at(jnp.float32(0))
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
        brightness = np.asarray(light_of(jnp.asarray(frame.indirect)), np.float64)
        used = frame.mask[..., 0] > 0 if frame.mask is not None else np.isfinite(brightness)
        total, count = total + float(brightness[used].sum()), count + float(used.sum())
    return total / count
