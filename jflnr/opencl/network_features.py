"""What the network reads: host side of kernels_cl/network/features.cl and whole.cl.

Its twin in JAX is jflnr/network/features.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from jflnr.network.features import BLURS, CHANNELS, COUNT, DARK, MOST_SPREAD, OF_GRID, OF_STEP
from jflnr.opencl.adaptive import Step
from jflnr.opencl.grids import GROUP, Grid, Run
from jflnr.opencl.network_unet import MARGIN, Maps, new_maps
from jflnr.opencl.pyramid import halve

FILE = "network/features.cl"
DEFINES: dict[str, Any] = {
    "DARK": f"{DARK}f",
    "MOST_SPREAD": f"{MOST_SPREAD}f",
    "CHANNELS": COUNT,
}
PACKED = 4 * (OF_GRID + OF_STEP + CHANNELS)


def of_steps(run: Run, steps: Sequence[Step], merged: Grid) -> Maps:
    """All that is read, on blocks twice as large as the finest: `COUNT` channels.

    steps: coarse to fine, three. merged: models of the finest grid.
    """
    h, _, w, _ = _sizes(steps[1])
    maps = new_maps(run.context, COUNT, h, w)
    light = _finest(run, steps[-1], merged, maps)
    coarsest = run.grid(OF_STEP, *_sizes(steps[0])[::2])
    _of_step(run, steps[0], _in_grid(coarsest))
    _spread(run, coarsest, steps[1].fine.moments, _in_map(maps, PACKED))
    _of_step(run, steps[1], _in_map(maps, PACKED + OF_STEP))
    moments = [step.fine.moments for step in reversed(steps[:2])] + [steps[0].coarse.moments]
    _blurred(run, moments, _in_map(maps, PACKED + 2 * OF_STEP))
    _whole(run, light, maps)
    return maps


def _sizes(step: Step) -> tuple[int, int, int, int]:
    """h, pitch, w and number of planes of a level's moments."""
    moments = step.fine.moments
    return *moments.size, moments.w, moments.number


class Output(NamedTuple):
    """Where planes are written, as kernels_cl/network/features.cl takes it."""

    start: int
    row: int
    group: int
    plane: int
    values: Any

    def plane_from(self, number: int) -> Output:
        """From another plane on."""
        return self._replace(start=self.start + number * self.plane)


def _in_grid(grid: Grid) -> Output:
    _, pitch = grid.size
    return Output(0, pitch * grid.number, GROUP * grid.number, GROUP, grid.planes)


def _in_map(maps: Maps, channel: int) -> Output:
    row = maps.channels * maps.pitch
    return Output(row + channel * maps.pitch + MARGIN, row, GROUP, maps.pitch, maps.values)


def _finest(run: Run, step: Step, merged: Grid, maps: Maps) -> Grid:
    """The channels of the finest blocks; returns two planes, brightness and its logarithm."""
    h, w, pitch = step.fine.moments.sizes
    light = run.grid(2, h, w)
    arguments = (
        h, w, pitch, *step.coarse.models.sizes, step.fine.features.number, maps.pitch, run.mean,
        *_arrays(step), merged.planes, light.planes, maps.values,
    )  # fmt: skip
    defines = DEFINES | {"COUNT": step.fine.moments.number}
    run.launch("finest", FILE, step.fine.moments, arguments, **defines)
    return light


def _of_step(run: Run, step: Step, output: Output) -> None:
    h, _, pitch = step.fine.moments.sizes
    coarse, planes = step.coarse.models.sizes, step.fine.features.number
    arguments = h, pitch, *coarse, planes, run.mean, *_arrays(step), *output
    defines = DEFINES | {"COUNT": step.fine.moments.number}
    run.launch("of_step", FILE, step.fine.moments, arguments, **defines)


def _arrays(step: Step) -> tuple[Any, ...]:
    fine, coarse, share = step
    grids = fine.moments, fine.features, fine.models, coarse.models, share
    return tuple(grid.planes for grid in grids)


def _spread(run: Run, coarse: Grid, on: Grid, output: Output, **defines: int) -> None:
    """Planes of a grid interpolated to the one `on` that is twice as fine."""
    h, _, pitch = on.sizes
    arguments = h, pitch, *coarse.sizes, coarse.number, run.mean, coarse.planes, *output
    run.launch("spread", FILE, on, arguments, **(DEFINES | {"COUNT": 0} | defines))


def _blurred(run: Run, moments: list[Grid], output: Output) -> None:
    """Light averaged over ever wider windows. moments: ever coarser, each half as fine."""
    while len(moments) < BLURS:
        moments = [*moments, halve(run, moments[-1])]
    coarser: Grid | None = None
    for i in reversed(range(BLURS)):
        grid = moments[i]
        # A plane of its own, then those of the coarser grids.
        light = run.grid(BLURS - i, grid.sizes[0], grid.w)
        to, logarithm = (output, {"LOG": 1}) if i == 0 else (_in_grid(light), {})
        h, _, pitch = grid.sizes
        defines = DEFINES | {"COUNT": grid.number} | logarithm
        run.launch("tent", FILE, grid, (h, pitch, run.mean, grid.planes, *to), **defines)
        if coarser is not None:
            _spread(run, coarser, grid, to.plane_from(1), **logarithm)
        coarser = light


def _whole(run: Run, light: Grid, maps: Maps) -> None:
    context, (h, w, pitch) = run.context, light.sizes
    partial, values = context.empty((h, 2)), context.empty((2,))
    defines = DEFINES | {"WIDTH": context.width()}
    rows = h, w, pitch, light.planes, partial
    context.run("whole_rows", "network/whole.cl", defines, (h,), rows)
    means = h, w, run.mean, partial, values
    context.run("whole_means", "network/whole.cl", defines, (1,), means)
    size = (maps.pitch - MARGIN) // context.width(), maps.h
    arguments, moved = (maps.h, maps.pitch, values, maps.values), 8 * maps.h * maps.w
    context.run("whole", "network/whole.cl", defines, size, arguments, moved)
