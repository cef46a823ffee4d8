"""Learned importance sampling in primary sample space, for references.

A sample of indirect light is a function of uniform points: one for the first direction, one for
the light. Each point is drawn instead from a piecewise constant density over 16 x 16 bins of the
unit square, learned where it is used: the first for tiles of pixels, the second for cells of
space. Whatever the density, `f(u) / q(u)` has the mean of `f`: nothing is biased, and multiple
importance sampling keeps its weights. The variance is least for `q` proportional to the root of
the mean of `f^2` in a bin, which is what is learned; a uniform share keeps `q` above a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

SIDE = 16
BINS = SIDE * SIDE
UNIFORM = 0.1  # share of the uniform density: no weight exceeds 10


@dataclass
class Table:
    """Densities for a grid of cells; `moments` and `cumulative` have `cells * BINS` entries."""

    shape: tuple[int, ...]
    moments: Any
    cumulative: Any

    @classmethod
    def of(cls, shape: tuple[int, ...]) -> Table:
        """Uniform densities for a grid of cells."""
        cells = int(np.prod(shape))
        steps = np.tile(np.arange(1, BINS + 1, dtype=np.float32) / BINS, cells)
        return cls(shape, dr.zeros(mi.Float, cells * BINS), mi.Float(steps))

    def warp(self, point: Any, cell: Any) -> tuple[Any, Any, Any]:
        """A point of the cell's density from a uniform one: the point, its `1 / q`, its bin."""
        base = cell * BINS
        index = dr.binary_search(
            0,
            BINS - 1,
            lambda i: dr.gather(mi.Float, self.cumulative, base + mi.UInt32(i)) <= point.x,
        )
        index = mi.UInt32(index)
        high = dr.gather(mi.Float, self.cumulative, base + index)
        low = dr.select(
            index > 0, dr.gather(mi.Float, self.cumulative, base + index - 1, index > 0), 0
        )
        width = dr.maximum(high - low, 1e-7)
        inside = dr.clip((point.x - low) / width, 0, 1 - 2.0**-24)
        row = index // SIDE
        x = (mi.Float(index - row * SIDE) + inside) / SIDE
        y = (mi.Float(row) + point.y) / SIDE
        return mi.Point2f(x, y), 1 / (BINS * width), base + index

    def record(self, entry: Any, inverse: Any, value: Any, active: Any) -> None:
        """Add a sample's `f^2 / q`, given its value `f / q` and `1 / q`."""
        dr.scatter_reduce(dr.ReduceOp.Add, self.moments, value * value / inverse, entry, active)

    def learn(self, blur: tuple[float, ...]) -> None:
        """Make the densities of what was recorded so far; `blur` over the grid, in cells."""
        moments = np.array(self.moments, np.float64).reshape(*self.shape, SIDE, SIDE)
        weight = np.sqrt(gaussian_filter(moments, (*blur, 0.6, 0.6), mode="nearest"))
        weight = weight.reshape(-1, BINS)
        total = weight.sum(1, keepdims=True)
        share = np.where(total > 0, weight / np.maximum(total, 1e-30), 1 / BINS)
        density = UNIFORM / BINS + (1 - UNIFORM) * share
        self.cumulative = mi.Float(np.cumsum(density, 1).astype(np.float32).ravel())
        dr.eval(self.cumulative)


TILE = 8  # pixels
GRID = 24  # cells along each axis of the box around what is seen


@dataclass
class Guide:
    """The tables of the first direction and of the light, and how to find their cells."""

    first: Table
    light: Table
    tile: Any
    low: Any
    scale: Any

    @classmethod
    def of(cls, width: int, height: int, position: NDArray[np.float32], mask: Any) -> Guide:
        """For a view of primary hits `position` `(H, W, 3)`, where `mask` `(H, W)` is true."""
        rows, columns = -(-height // TILE), -(-width // TILE)
        lane = dr.arange(mi.UInt32, width * height)
        w, across = dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, columns)
        y = lane // w
        tile = (y // TILE) * across + (lane - y * w) // TILE
        dr.eval(tile)
        seen = position[mask] if mask.any() else np.zeros((1, 3))
        low, high = np.quantile(seen, 0.01, axis=0), np.quantile(seen, 0.99, axis=0)
        margin = 0.15 * float((high - low).max()) + 1e-6
        low, high = low - margin, high + margin
        return cls(
            Table.of((rows, columns)),
            Table.of((GRID, GRID, GRID)),
            tile,
            [dr.opaque(mi.Float, float(v)) for v in low],
            [dr.opaque(mi.Float, float(v)) for v in GRID / (high - low)],
        )

    def cell(self, p: Any) -> Any:
        """The cell of space that holds a point; points outside belong to the nearest one."""
        index = mi.UInt32(0)
        for axis in range(3):
            i = (p[axis] - self.low[axis]) * self.scale[axis]
            index = index * GRID + mi.UInt32(dr.clip(i, 0, GRID - 1))
        return index

    def learn(self) -> None:
        """Make both densities of what was recorded so far."""
        self.first.learn((0.7, 0.7))
        self.light.learn((0.4, 0.4, 0.4))
