"""Host side of kernels_cl/pyramid.cl; its twin in JAX is jflnr/flr/pyramid.py."""

from __future__ import annotations

from typing import Any

from jflnr.opencl.grids import MARGIN, Grid, Run, stride_of


def halve(run: Run, planes: Any, w: int, start: int = 0) -> Any:
    """Mean of 2 x 2 blocks, zeros beyond the border.

    planes: `(K, h, stride)` with w columns from column `start` on.
    Returns `(K, ceil(h / 2), stride)`, with margins.
    """
    count, h, stride = planes.shape
    half_h, half_stride = -(-h // 2), stride_of(-(-w // 2))
    halves = run.context.empty((count, half_h, half_stride))
    sizes = (count, h, w, stride, start, half_h, half_stride - 2 * MARGIN)
    run.launch("halve", "pyramid.cl", (half_stride, half_h, count), (*sizes, planes, halves))
    return halves


def halve_grid(run: Run, grid: Grid) -> Grid:
    """The same moments at blocks twice as large."""
    return Grid(halve(run, grid.moments, grid.w, MARGIN), -(-grid.w // 2), 2 * grid.block)
