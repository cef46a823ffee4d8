"""Host side of kernels_cl/merge.cl and choose.cl; its twin in JAX is jflnr/regression/merge.py."""

from typing import Any

import numpy as np

from jflnr.opencl.grids import GROUP, Grid, Run
from jflnr.opencl.level import Level, new_models
from jflnr.opencl.resampling import halve


def choose(run: Run, share: Grid, h: int, w: int) -> Any:
    """The tiles of the finest grid, of h x w blocks, that are refined: see
    `jflnr.regression.multiscale.chosen`. Returns `(ceil(h / GROUP), pitch / GROUP)`, uint8."""
    tiles = run.context.empty((-(-h // GROUP), -(-w // GROUP)), np.uint8)
    arguments = *share.sizes, tiles.shape[1], run.numbers.worth, share.planes, tiles
    run.launch("choose", "choose.cl", share, arguments)
    return tiles


def signal_share(run: Run, fine: Level, coarse: Level) -> Grid:
    """The share of signal in the difference between two levels, one plane on the coarser grid.

    Means are taken under the windows of the coarser level.
    """
    windows = coarse.features.planes
    signal = halve(run, _signal(run, fine, coarse))
    h, w, pitch = signal.sizes
    rows, share = run.grid(3, h, w), run.grid(1, h, w)
    sizes = h, pitch, coarse.refines, run.numbers.sigma
    along_rows = *sizes, windows, signal.planes, rows.planes
    run.launch("share_rows", "merge.cl", signal, along_rows)
    down = *sizes, run.numbers.caution, windows, rows.planes, share.planes
    run.launch("share_columns", "merge.cl", signal, down)
    return share


def _signal(run: Run, fine: Level, coarse: Level) -> Grid:
    """Squared difference, what noise would make of it, and where there are pixels: three planes."""
    h, w, pitch = fine.models.sizes
    signal = run.grid(3, h, w)
    arguments = (
        h, pitch, *coarse.models.sizes, run.numbers.guide_scale, fine.tiles, run.mean,
        fine.moments.planes, fine.features.planes, fine.models.planes, coarse.models.planes,
        signal.planes,
    )  # fmt: skip
    run.launch("signal", "merge.cl", signal, arguments)
    return signal


def merge(run: Run, fine: Level, coarse: Level, merged: Grid, share: Grid) -> Grid:
    """Models `merged + share (fine - coarse)` on the finer grid."""
    h, w, pitch = fine.models.sizes
    result = new_models(run, h, w)
    arguments = (
        h, pitch, *coarse.models.sizes, fine.tiles, fine.models.planes, coarse.models.planes,
        merged.planes, share.planes, result.planes,
    )  # fmt: skip
    run.launch("merge", "merge.cl", result, arguments)
    return result
