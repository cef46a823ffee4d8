"""A frame of which a few rows at a time are had."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import jax
import numpy as np

from jflnr.frame import Frame
from jflnr.images import guides as guide_layers
from jflnr.images.inputs import factor_of


@dataclass(frozen=True)
class Rows:
    """The rows of a frame on demand.

    height, width: of the guides, in pixels. read: the rows from one to another, as a frame; None
    for layers that are not needed. factor: how many times smaller the light is.
    """

    height: int
    width: int
    read: Callable[[int, int], Frame]
    factor: int = 1

    def shapes(self) -> Frame:
        """The frame, but for what is in it."""
        rows = self.read(0, self.factor)
        light = -(-self.height // self.factor)
        grow = lambda a, height: jax.ShapeDtypeStruct((height, *a.shape[1:]), a.dtype)
        whole = jax.tree.map(lambda a: grow(a, self.height), rows)
        return dataclasses.replace(whole, indirect=grow(rows.indirect, light))


def rows_of(frame: Frame) -> Rows:
    """The rows of a frame that is in memory."""
    (height, width), factor = frame.normal.shape[:2], factor_of(frame)

    def read(start: int, stop: int) -> Frame:
        coarse = np.asarray(frame.indirect[start // factor : -(-stop // factor)])
        fine = jax.tree.map(lambda layer: np.asarray(layer[start:stop]), frame)
        return dataclasses.replace(fine, indirect=coarse)

    return Rows(height, width, read, factor)


def scene_of(rows: Rows) -> guide_layers.Scene:
    """`guides.scene_of` of the whole frame, from the few rows that it looks at."""
    step = guide_layers.thinning(rows.height, rows.width)
    found = [rows.read(row, row + 1) for row in range(0, rows.height, step)]
    sample = jax.tree.map(lambda *lines: np.concatenate(lines)[:, ::step], *found)
    position = rows.read(rows.height // 2, rows.height // 2 + 1).position
    middle = None if position is None else position[0, rows.width // 2]
    return guide_layers.scene_from(sample, middle)
