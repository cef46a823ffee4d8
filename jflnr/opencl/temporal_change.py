"""How the light has changed: host side of kernels_cl/temporal/difference.cl and change.cl.

Its twin in JAX is jflnr/temporal/change.py.
"""

from typing import Any, NamedTuple

import numpy as np

from jflnr.opencl.apply import apply
from jflnr.opencl.context import Context
from jflnr.opencl.grids import GROUP, Grid, Run, brightness_defines
from jflnr.opencl.level import Level, fit_level
from jflnr.opencl.moments import centre, collect, guide_defines, run_on_rows
from jflnr.regression.adaptive import DEFAULT
from jflnr.regression.moments import plane_count
from jflnr.temporal.change import BLOCK, BRIGHTEST, DIM, FOLLOWED, NEWEST, NOVELTY, UNCOVERED

NUMBERS = DEFAULT
# Planes that are averaged over the windows, see change.cl.
PLANES = 5
FILE = "temporal/change.cl"


class Change(NamedTuple):
    """What has changed. signal: `(H, W, 3)`, in units. noise: `(H, W, 1)`. unit: `(1,)`."""

    signal: Any
    noise: Any
    unit: Any


def no_evidence(context: Context, height: int, width: int) -> Any:
    """Before the first frame: power and noise, two planes of a grid."""
    h, w = -(-height // BLOCK), -(-width // BLOCK)
    return context.array(np.zeros((h, -(-w // GROUP), 2, GROUP), np.float32))


def find_change(
    context: Context,
    sample: Any,
    light: Any,
    expected: Any,
    known: Any,
    covered: Any,
    guides: tuple[Any, ...],
    evidence: Any,
    caution: float,
) -> tuple[Change, Any]:
    """`jflnr.temporal.change.find_change`, of device arrays.

    sample, light: `(H, W, 3)`, the new frame and the history. expected: `(H, W)`, brightness of the
    history. covered: `(H, W, 1)`, above 0 where there is something to denoise. known: `(H, W)`, 1
    where that has a history.
    """
    target, weight, unit = _difference(context, sample, light, expected, known)
    shift, mean = centre(context, guides), context.array(np.ones(2, np.float32))
    moments = collect(context, target, guides, shift, BLOCK, weight)
    count = sum(layer.shape[2] for layer in guides)
    run = Run(context, count, 3, NUMBERS, shift, mean)
    grid, luminance = _arrange(run, moments, -(-sample.shape[1] // BLOCK))
    fit = fit_level(run, grid, BLOCK)
    model, wrong, evidence = _judge(run, fit, luminance, evidence, caution)
    # The history is wrong also around places that come into view.
    uncovered = *known.shape, grid.size[1], BLOCK, UNCOVERED, known, covered, wrong
    run.launch("add_uncovered", FILE, grid, uncovered, WIDTH=1)
    signal, noise = context.empty(sample.shape), context.empty((*sample.shape[:2], 1))
    apply(context, model, guides, shift, BLOCK, grid.sizes, signal)
    apply(context, wrong, (), shift, BLOCK, grid.sizes, noise)
    return Change(signal, noise, unit), evidence


def _difference(
    context: Context, sample: Any, light: Any, expected: Any, known: Any
) -> tuple[Any, Any, Any]:
    """Target `(H, W, 5)` and weight `(H, W)` for the moments, and the unit, `(1,)`."""
    height, width = sample.shape[:2]
    rows, unit = context.empty((height, 2)), context.empty((1,))
    defines = guide_defines((), 5) | brightness_defines(3) | {"WIDTH": context.width()}
    file = "temporal/difference.cl"
    context.run("unit_rows", file, defines, (height,), (width, height, expected, known, rows))
    context.run("unit", file, defines, (1,), (height, rows, unit))
    target, weight = context.empty((height, width, 5)), context.empty((height, width))
    numbers = width, height, NUMBERS.offset, BRIGHTEST
    arguments = *numbers, sample, light, expected, known, unit, target, weight
    run_on_rows(context, "difference", file, defines, arguments)
    return target, weight, unit


def _arrange(run: Run, moments: Any, w: int) -> tuple[Grid, Grid]:
    """The moments of the difference and its noise, and the brightness of the history."""
    h, from_pitch = moments.shape[1:]
    grid, luminance = run.grid(plane_count(run.guides, 3) + 1, h, w), run.grid(1, h, w)
    arguments = h, w, grid.size[1], from_pitch, moments, grid.planes, luminance.planes
    run.launch("arrange", FILE, grid, arguments, WIDTH=1)
    return grid, luminance


def _judge(
    run: Run, fit: Level, luminance: Grid, evidence: Any, caution: float
) -> tuple[Any, Any, Any]:
    """The models of what is signal, `(Q + 1, 3, h, pitch)`, the noise that the history takes on,
    `(1, 1, h, pitch)`, and the evidence for the next frame."""
    h, w, pitch = fit.models.sizes
    planes, rows, after = run.grid(PLANES, h, w), run.grid(PLANES, h, w), run.grid(2, h, w)
    model = run.context.empty((run.guides + 1, 3, h, pitch))
    wrong = run.context.empty((1, 1, h, pitch))
    features, moments, models = fit.features.planes, fit.moments.planes, fit.models.planes

    def launch(name: str, *arguments: Any) -> None:
        run.launch(name, FILE, rows, (h, pitch, *arguments))

    scale, sigma = run.numbers.guide_scale, run.numbers.sigma
    launch("measure", DIM, scale, moments, features, models, luminance.planes, planes.planes)
    launch("change_rows", sigma, features, planes.planes, rows.planes)
    launch(
        "judge", sigma, caution, NEWEST, FOLLOWED, NOVELTY, features, moments, rows.planes, models,
        evidence, after.planes, model, wrong,
    )  # fmt: skip
    return model, wrong, after.planes
