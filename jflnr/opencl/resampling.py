"""Host side of kernels_cl/resampling.cl; its twin in JAX is jflnr/regression/resampling.py."""

from typing import Any

from jflnr.opencl.grids import GROUP, Grid, Run


def halve(run: Run, grid: Grid) -> Grid:
    """Mean of 2 x 2 blocks, zeros beyond the border."""
    (h, pitch), count = grid.size, grid.number
    strides = pitch * count, GROUP * count, GROUP
    return _halve(
        run, grid.planes, (h, pitch), strides, run.grid(count, -(-h // 2), -(-grid.w // 2))
    )


def halve_planes(run: Run, planes: Any, w: int) -> Grid:
    """The same from separate planes `(K, h, pitch)` with w columns, and zeros from there on."""
    count, h, pitch = planes.shape
    strides = pitch, GROUP, h * pitch
    return _halve(run, planes, (h, pitch), strides, run.grid(count, -(-h // 2), -(-w // 2)))


def _halve(
    run: Run, planes: Any, size: tuple[int, int], strides: tuple[int, int, int], halves: Grid
) -> Grid:
    """strides: from one row, group of neighbours and plane to the next."""
    arguments = (halves.number, *size, *strides, *halves.size, planes, halves.planes)
    h, pitch = halves.size
    lanes = run.context.width()
    run.context.run("halve", "resampling.cl", {"WIDTH": lanes}, (pitch // lanes, h), arguments)
    return halves
