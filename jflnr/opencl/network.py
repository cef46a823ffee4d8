"""FLNR on an OpenCL device: the steps of jflnr/flnr/regression.py (docs/flnr.md)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import numpy as np

from jflnr.flnr import features, regression, unet
from jflnr.flr.adaptive import LEVELS
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.arguments import channel_count, check_regression
from jflnr.opencl import network_features, network_unet
from jflnr.opencl.adaptive import fit_pilot, in_unit
from jflnr.opencl.apply import Restored, apply
from jflnr.opencl.arguments import to_layers, to_output, to_weight
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.energy import frame_mean, rescale, restore
from jflnr.opencl.floor import own_light
from jflnr.opencl.grids import Grid, Run
from jflnr.opencl.level import fit_level, new_models
from jflnr.opencl.merge import merge, signal_share
from jflnr.opencl.moments import centre, collect
from jflnr.opencl.network_features import Step
from jflnr.opencl.network_unet import Maps
from jflnr.opencl.pyramid import halve
from jflnr.opencl.weighted_moments import collect_weighted

GUIDES = 5
BLOCK = regression.BLOCK


def flnr(
    target: Any,
    guides: Any,
    params: unet.Params,
    *,
    weight: Any | None = None,
    keep_energy: bool = False,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
) -> Any:
    """`jflnr.flnr.regression.flnr` on an OpenCL device: same arguments, same result.

    keep_energy: as in `flr_adaptive`. target, guides and weight may be arrays of numpy or JAX, or
    device arrays; context, out and on_device: as in `jflnr.opencl.flr`.
    Returns `(H, W, 3)`, float32 unless `out` is given.

    Raises `ValueError` or `TypeError`, naming the argument; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    check_regression(target, guides, None, weight, 2 * BLOCK, 1)
    counts = channel_count(guides), target.shape[2]
    if counts != (GUIDES, features.CHANNELS):
        raise ValueError(
            f"guides and target must have {GUIDES} and {features.CHANNELS} channels, as in "
            f"training; got {counts[0]} and {counts[1]}"
        )
    output, result = to_output(context, target.shape, out, on_device)
    pixels, unit = in_unit(target)
    images = context.array(pixels), to_layers(context, guides)
    weight = to_weight(context, weight)
    image = context.empty(target.shape) if keep_energy else output
    frame = prepare(context, *images, weight)
    models, own = finish(params, frame)
    # They are scaled already.
    rate, brightness = context.array(np.zeros(1, np.float32)), frame.restored[1]
    restored = Restored(rate, brightness, own, float(frame.run.numbers.floor))
    shift, sizes = frame.run.shift, models.sizes
    apply(context, models.planes, images[1], shift, BLOCK, sizes, image, restored)
    if keep_energy:
        rescale(context, image, images[0], weight, output)
    if unit != 1:
        output *= unit
    return context.finish(output, result)


class Prepared(NamedTuple):
    """A frame after its regressions: what the network reads, and what it steers.

    steps: coarse to fine. x: what is read. restored: from `energy.restore`.
    """

    run: Run
    steps: list[Step]
    x: Maps
    restored: tuple[Any, Any]


def prepare(context: Context, target: Any, guides: tuple[Any, ...], weight: Any | None) -> Prepared:
    """All that comes before the network; arguments on the device."""
    w, shift = -(-target.shape[1] // (2 * BLOCK)), centre(context, guides)
    moments = collect(context, target, guides, shift, 2 * BLOCK, weight, light=True)
    mean = frame_mean(context, moments, w, GUIDES)
    numbers = jax.tree.map(lambda number: math.exp(float(number)), ADAPTIVE_DEFAULT)
    run = Run(context, GUIDES, features.CHANNELS, numbers, shift, mean)
    pilot = fit_pilot(run, moments, w, BLOCK)
    steps, merged = _fit_levels(run, collect_weighted(run, target, guides, pilot, weight, BLOCK))
    restored = restore(run, merged, moments, w)
    return Prepared(run, steps, network_features.of_steps(run, steps, merged), restored)


def finish(params: unet.Params, frame: Prepared) -> tuple[Grid, Grid]:
    """Merge the levels and correct the light as the network says.

    Returns the models of the finest grid, and the light that each gives its block.
    """
    run, steps, x, restored = frame
    said = network_unet.apply(run.context, params, x)
    merged = steps[0].coarse.models
    for step, outputs, channel in zip(
        steps[:-1], said[::-1], (0, said[0].channels - 1), strict=True
    ):
        merged = _steer(run, step, outputs, channel, merged)
    models = _finish(run, steps[-1], said[0], merged, restored)
    return models, own_light(run, models, steps[-1].fine.moments)


def _fit_levels(run: Run, moments: Grid) -> tuple[list[Step], Grid]:
    """The steps from the coarsest level to the finest, and the models they are merged to."""
    grids = [moments]
    for _ in range(LEVELS - 1):
        grids.append(halve(run, grids[-1]))
    coarse = fit_level(run, grids[-1], BLOCK << (LEVELS - 1))
    steps, merged = list[Step](), coarse.models
    for level in reversed(range(LEVELS - 1)):
        fine = fit_level(run, grids[level], BLOCK << level, merged, slopes=level > 0)
        steps.append(Step(fine, coarse, signal_share(run, fine, coarse)))
        merged = merge(run, fine.models, coarse.models, merged, steps[-1].share)
        coarse = fine
    return steps, merged


def _steer(run: Run, step: Step, said: Maps, channel: int, merged: Grid) -> Grid:
    h, w, pitch = step.fine.models.sizes
    finer = new_models(run, h, w)
    arguments = (
        h, pitch, *merged.sizes, said.pitch, channel, said.values, *_models(step, merged),
        finer.planes,
    )  # fmt: skip
    run.launch("steer", "network/steer.cl", finer, arguments, **_defines(said))
    return finer


def _finish(run: Run, step: Step, said: Maps, merged: Grid, restored: tuple[Any, Any]) -> Grid:
    rate, brightness = restored
    h, w, pitch = step.fine.models.sizes
    models = new_models(run, h, w)
    arguments = (
        h, pitch, *merged.sizes, said.pitch, brightness.shape[1], said.values,
        *_models(step, merged), run.mean, rate, brightness, models.planes,
    )  # fmt: skip
    run.launch("finish", "network/steer.cl", models, arguments, **_defines(said))
    return models


def _models(step: Step, merged: Grid) -> tuple[Any, ...]:
    grids = step.fine.models, step.coarse.models, merged, step.share
    return tuple(grid.planes for grid in grids)


def _defines(said: Maps) -> dict[str, Any]:
    numbers = {
        "LARGEST_CHANGE": regression.LARGEST_CHANGE,
        "LARGEST_GAIN": regression.LARGEST_GAIN,
        "DARK": features.DARK,
    }
    return {name: f"{number}f" for name, number in numbers.items()} | {"OUTPUTS": said.channels}
