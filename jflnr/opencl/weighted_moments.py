"""Host side of kernels_cl/weighted_moments.cl; its twin in JAX is jflnr/flr/weighted_moments.py."""

from __future__ import annotations

from typing import Any

from jflnr.flr.moments import plane_count
from jflnr.opencl.grids import MARGIN, REACH, Grid, Run, brightness_defines, stride_of
from jflnr.opencl.level import Models
from jflnr.opencl.moments import guide_arguments, pixel_defines


def collect_weighted(
    run: Run, target: Any, guides: tuple[Any, ...], pilot: Models, weight: Any | None, block: int
) -> Grid:
    """Pass 2: moments of the weighted pixels on the finest blocks, and the noise.

    target: `(H, W, C)`. guides: each `(H, W, Q_i)`. pilot: models of the brightness on blocks four
    times as large. weight: `(H, W)`, float32 or bool, or None.
    """
    context = run.context
    height, width, channels = target.shape
    h, w = -(-height // block), -(-width // block)
    lanes = context.width(2 * block)
    if block % lanes and lanes != 2 * block:
        lanes = context.width(block)
    moments = context.empty((plane_count(run.guides, channels) + 1, h, stride_of(w)))
    defines = {**pixel_defines(target, guides, weight, block), **brightness_defines(channels)}
    defines |= {"WIDTH": lanes, "REACH": REACH, "MARGIN": MARGIN}
    arguments = (
        width, height, h, stride_of(w) - 2 * MARGIN, *pilot.sizes, run.numbers.exponent,
        run.numbers.offset, target, *guide_arguments(guides), weight, run.shift, pilot.coefficients,
        run.mean, moments,
    )  # fmt: skip
    columns = stride_of(w) // (2 if lanes > block else 1)
    context.run("weighted_moments", "weighted_moments.cl", defines, (columns, h), arguments)
    return Grid(moments, w, block)
