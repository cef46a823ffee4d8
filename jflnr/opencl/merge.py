"""Host side of kernels_cl/merge.cl; its twin in JAX is jflnr/flr/merge.py."""

from __future__ import annotations

from typing import Any

from jflnr.opencl.grids import Grid, Run, pitch_of
from jflnr.opencl.level import Fit, Models
from jflnr.opencl.pyramid import halve


def signal_share(run: Run, grid: Grid, fine: Fit, coarse: Fit) -> Any:
    """The share of signal in the difference between two levels, `(h, pitch)` on the coarser grid.

    grid, fine: the finer level. coarse: the next coarser one, over whose window means are taken.
    """
    h, w, pitch = fine.models.sizes
    signal = run.context.empty((3, h, pitch))
    arguments = (
        h, pitch, *coarse.models.sizes, run.numbers.guide_scale, run.mean, grid.moments,
        fine.features, fine.models.light, coarse.models.light, signal,
    )  # fmt: skip
    run.launch("signal", "merge.cl", (pitch, h), arguments, FEATURES=coarse.similar)
    return _share(run, halve(run, signal, w), coarse)


def _share(run: Run, halved: Any, coarse: Fit) -> Any:
    h, w = halved.shape[1], coarse.models.w
    pitch, numbers = pitch_of(w), run.numbers
    rows, share = run.context.empty((3, h, pitch)), run.context.empty((h, pitch))
    arguments = (h, pitch, numbers.sigma, coarse.features, halved, rows)
    run.launch("share_rows", "merge.cl", (pitch, h), arguments, FEATURES=coarse.similar)
    arguments = (h, pitch, numbers.sigma, numbers.caution, coarse.features, rows, share)
    run.launch("share_columns", "merge.cl", (pitch, h), arguments, FEATURES=coarse.similar)
    return share


def merge(run: Run, fine: Models, coarse: Models, merged: Models, share: Any) -> Models:
    """`merged + share (fine - coarse)` on the finer grid."""
    h, w, pitch = fine.sizes
    coefficients = run.context.empty(fine.coefficients.shape)
    light = run.context.empty((run.guides + 1, h, pitch))
    arguments = (
        h, pitch, *coarse.sizes, fine.coefficients, coarse.coefficients, merged.coefficients, share,
        coefficients, light,
    )  # fmt: skip
    run.launch("merge", "merge.cl", (pitch, h), arguments, FEATURES=0)
    return Models(coefficients, light, w)
