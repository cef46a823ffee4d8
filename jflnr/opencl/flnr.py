"""FLNR on an OpenCL device: the steps of jflnr/network/flnr.py (docs/flnr.md)."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, NamedTuple

import numpy as np

from jflnr.network import features, unet
from jflnr.network import flnr as twin
from jflnr.network.flnr import DEFAULT, FLNR
from jflnr.opencl import network_features, network_unet
from jflnr.opencl.adaptive import fit_levels, fit_pilot, in_unit
from jflnr.opencl.apply import Restored, apply
from jflnr.opencl.arguments import numbers_of, to_layers, to_output, to_weight
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.energy import frame_mean, rescale, restore
from jflnr.opencl.floor import own_light
from jflnr.opencl.grids import Grid, Run
from jflnr.opencl.level import Alike, new_models
from jflnr.opencl.moments import centre, collect
from jflnr.opencl.network_unet import Maps
from jflnr.opencl.pyramid import halve
from jflnr.opencl.weighted_moments import collect_weighted
from jflnr.regression.arguments import channel_count, check_regression

GUIDES = 5
BLOCK, LEVELS = DEFAULT.finest, DEFAULT.levels
FILE = "network/steer.cl"


def flnr(
    target: Any,
    guides: Any,
    method: FLNR = DEFAULT,
    *,
    weight: Any | None = None,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
    **options: Any,
) -> Any:
    """`jflnr.flnr` on an OpenCL device: same arguments, same result.

    target, guides and weight may be arrays of numpy or JAX, or
    device arrays; context, out and on_device: as in `jflnr.opencl.flr`.
    Returns `(H, W, 3)`, float32 unless `out` is given.

    Raises `ValueError` or `TypeError`, naming the argument; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    method = dataclasses.replace(method, **options).with_weights()
    check_regression(target, guides, None, weight)
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
    image = context.empty(target.shape) if method.keep_energy else output
    frame = prepare(context, *images, weight, method)
    models, own = finish(method.params, frame)
    # They are scaled already.
    rate, brightness = context.array(np.zeros(1, np.float32)), frame.restored[1]
    restored = Restored(rate, brightness, own, frame.run.numbers.floor)
    shift, sizes = frame.run.shift, models.sizes
    apply(context, models.planes, images[1], shift, BLOCK, sizes, image, restored)
    if method.keep_energy:
        rescale(context, image, images[0], weight, output)
    if unit != 1:
        context.scale(output, unit)
    return context.finish(output, result)


class Prepared(NamedTuple):
    """A frame after its first regression: what the network reads, and what it steers.

    moments: of the finest blocks. x: what is read. restored: from `energy.restore`.
    """

    run: Run
    moments: Grid
    x: Maps
    restored: tuple[Any, Any]


def prepare(
    context: Context, target: Any, guides: tuple[Any, ...], weight: Any | None, method: FLNR
) -> Prepared:
    """All that comes before the network; arguments on the device."""
    w, shift = -(-target.shape[1] // (2 * BLOCK)), centre(context, guides)
    moments = collect(context, target, guides, shift, 2 * BLOCK, weight, light=True)
    mean = frame_mean(context, moments, w, GUIDES)
    numbers = numbers_of(dataclasses.replace(method, params=None))
    run = Run(context, GUIDES, features.CHANNELS, numbers, shift, mean)
    pilot = fit_pilot(run, moments, w, BLOCK)
    grid = collect_weighted(run, target, guides, pilot, weight, BLOCK)
    steps, merged = fit_levels(run, grid, BLOCK, LEVELS)
    x = network_features.of_steps(run, steps, merged)
    return Prepared(run, grid, x, restore(run, merged, moments, w))


def finish(params: unet.Params, frame: Prepared) -> tuple[Grid, Grid]:
    """Fit anew and correct the light as the network says.

    Returns the models of the finest grid, and the light that each gives its block.
    """
    run, moments, x, restored = frame
    said = network_unet.apply(run.context, params, x)[0]
    says, weighed = _heed(run, said, moments)
    levels = [says]
    for _ in range(LEVELS - 1):
        levels.append(halve(run, levels[-1]))
    steers = [functools.partial(_steer, run, own) for own in levels]
    merged = fit_levels(run, weighed, BLOCK, LEVELS, steers)[1]
    models = _correct(run, said, merged, restored)
    return models, own_light(run, models, moments)


def _heed(run: Run, said: Maps, moments: Grid) -> tuple[Grid, Grid]:
    """What concerns windows, and the moments that weigh as said."""
    h, w, pitch = moments.sizes
    says, weighed = run.grid(twin.ALIKE + 1, h, w), run.grid(moments.number, h, w)
    arguments = (
        h, w, pitch, said.pitch, said.values, moments.planes, says.planes, weighed.planes,
    )  # fmt: skip
    run.launch("heed", FILE, says, arguments, **_defines(said.channels, COUNT=moments.number))
    return says, weighed


def _steer(run: Run, says: Grid, features: Grid, count: int) -> Alike:
    """What decides the windows of a level whose first `count` features must be alike."""
    h, w, pitch = says.sizes
    windows = run.grid(says.number, h, w)
    arguments = h, pitch, features.number, features.planes, says.planes, windows.planes
    run.launch("steer", FILE, windows, arguments, **_defines(BEFORE=count))
    return Alike(windows, twin.ALIKE, wider=True)


def _correct(run: Run, said: Maps, merged: Grid, restored: tuple[Any, Any]) -> Grid:
    rate, brightness = restored
    h, w, pitch = merged.sizes
    models = new_models(run, h, w)
    arguments = (
        h, pitch, said.pitch, brightness.shape[1], said.values, merged.planes, run.mean, rate,
        brightness, models.planes,
    )  # fmt: skip
    run.launch("correct", FILE, models, arguments, **_defines(said.channels))
    return models


def _defines(outputs: int = 0, **more: int) -> dict[str, Any]:
    """Those of kernels_cl/network/steer.cl."""
    numbers = {
        "LARGEST_WIDTH": twin.LARGEST_WIDTH,
        "LARGEST_WEIGHT": twin.LARGEST_WEIGHT,
        "LARGEST_GAIN": twin.LARGEST_GAIN,
        "DARK": features.DARK,
    }
    counts = {"OUTPUTS": outputs, "ALIKE": twin.ALIKE, "COUNT": 0, "BEFORE": 0}
    return {name: f"{number}f" for name, number in numbers.items()} | counts | more
