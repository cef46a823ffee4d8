"""Host side of kernels_cl/uncertainty.cl; its twin in JAX is jflnr/regression/uncertainty.py."""

from collections.abc import Sequence
from typing import Any

from jflnr.opencl.apply import apply
from jflnr.opencl.grids import Grid, Run
from jflnr.opencl.level import Step
from jflnr.regression.uncertainty import DETAIL, LEFT_OUT, VARIANCE


def standard_error(
    run: Run, steps: Sequence[Step], scale: tuple[Any, Any], own: Grid, step: int, output: Any
) -> None:
    """Write the standard error of the brightness of every pixel to `output`, `(H, W, 1)`.

    steps: coarse to fine. scale: from `energy.restore`. own: from `floor.own_light`. step: side of
    the finest blocks in pixels.
    """
    before: Grid | None = None
    for fine, coarse, share in steps:
        h, w, pitch = fine.models.sizes
        after = run.grid(2, h, w)
        arguments = (
            h, pitch, *coarse.models.sizes, fine.tiles, fine.moments.planes, fine.models.planes,
            coarse.models.planes, share.planes, None if before is None else before.planes,
            after.planes,
        )  # fmt: skip
        defines: dict[str, Any] = {"FIRST": 1} if before is None else {}
        run.launch("error_step", "uncertainty.cl", after, arguments, **defines)
        before = after
    assert before is not None
    (h, w, pitch), (rate, brightness) = before.sizes, scale
    error = run.context.empty((1, 1, h, pitch))
    of_grid = (
        h, pitch, brightness.shape[1], VARIANCE, LEFT_OUT, DETAIL, run.mean, rate, brightness,
        own.planes, before.planes, error,
    )  # fmt: skip
    run.launch("standard_error", "uncertainty.cl", before, of_grid)
    apply(run.context, error, (), run.shift, step, (h, w, pitch), output)
