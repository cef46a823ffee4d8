"""A frame of which a few rows at a time are had."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import guides as guide_layers
from jflnr.flr.arguments import times_finer
from jflnr.flr.moments import Guides, centre
from jflnr.frame import Frame


@dataclass(frozen=True)
class Rows:
    """The rows of a frame on demand.

    height, width: of the guides, in pixels. read: the rows from one to another, as a frame; None
    for layers that are not needed. factor: how many times smaller the light is. channels: its
    number of channels.
    """

    height: int
    width: int
    read: Callable[[int, int], Frame]
    factor: int = 1
    channels: int = 3


def rows_of(frame: Frame) -> Rows:
    """The rows of a frame that is in memory."""
    (height, width), light = frame.normal.shape[:2], frame.indirect.shape
    factor = times_finer((height, width), (light[0], light[1])) or 1

    def read(start: int, stop: int) -> Frame:
        fine = {
            name: None if image is None else np.asarray(image[start:stop])
            for name, image in vars(frame).items()
        }
        coarse = np.asarray(frame.indirect[start // factor : -(-stop // factor)])
        return Frame(**fine | {"indirect": coarse})  # type: ignore[arg-type]

    return Rows(height, width, read, factor, light[2])


def read_with_neighbours(rows: Rows, low: int, high: int) -> Frame:
    """Some rows, and one above and below; NaN beyond the frame."""
    first, last = max(low - 1, 0), min(high + 1, rows.height)
    margin = ((first - low + 1, high + 1 - last), (0, 0), (0, 0))
    strip = rows.read(first, last)
    if not any(margin[0]):
        return strip
    return jax.tree.map(lambda a: np.pad(a, margin, constant_values=np.nan), strip)


def scene_of(rows: Rows) -> guide_layers.Scene:
    """`guides.scene_of` of the whole frame, from the few rows that it looks at."""
    step = guide_layers.depth_step(rows.height, rows.width)
    found = [rows.read(row, row + 1) for row in range(0, rows.height, step)]
    depths = np.concatenate([row.depth[:, ::step] for row in found])
    masks = [row.mask[:, ::step] for row in found if row.mask is not None]
    depth = guide_layers.typical_depth(depths, np.concatenate(masks) if masks else None)
    position = rows.read(rows.height // 2, rows.height // 2 + 1).position
    if position is None:
        return guide_layers.Scene(depth, jnp.zeros(3))
    return guide_layers.Scene(depth, jnp.nan_to_num(position[0, rows.width // 2]))


def shift_of(rows: Rows, images: Callable[[Frame], tuple[Guides, jax.Array | None]]) -> jax.Array:
    """`moments.centre` of the whole frame, from the few rows that it looks at.

    images: the guides and the weight of a frame; of three rows the middle one counts.
    """
    return centre(*sparse(rows, images))


def sparse(rows: Rows, images: Callable[[Frame], Any]) -> Any:
    """What is made of the few rows of a frame that typical values are told from, `(n, W, ...)`.

    images: of three rows the middle one counts.
    """
    step = max(rows.height // 32, 1)
    found = [
        jax.tree.map(lambda a: a[1:2], images(read_with_neighbours(rows, row, row + 1)))
        for row in range(0, rows.height, step)
    ]
    return jax.tree.map(lambda *lines: jnp.concatenate(lines), *found)
