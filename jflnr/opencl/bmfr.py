"""BMFR on an OpenCL device: host side of kernels_cl/bmfr/; its twin is jflnr/temporal/bmfr.py."""

from __future__ import annotations

from typing import Any

import numpy as np

from jflnr.frame import Frame
from jflnr.opencl.arguments import to_output
from jflnr.opencl.bmfr_fit import fit
from jflnr.opencl.context import Context, default_context, is_device_array
from jflnr.temporal import bmfr
from jflnr.temporal.bmfr import DARK, PAPER, BmfrParameters, History
from jflnr.temporal.reproject import OFF_PLANE, SAME_NORMAL, Surface


def start(frame: Frame, context: Context | None = None) -> History:
    """`jflnr.temporal.bmfr.start`, on the device."""
    context = default_context() if context is None else context
    zeros = lambda channels: context.array(np.zeros((*size, channels), np.float32))
    size = frame.normal.shape[:2]
    surface = Surface(zeros(3), zeros(1), None if frame.position is None else zeros(3))
    return History(0, surface, zeros(1), zeros(3), zeros(3), zeros(3))


def step(
    history: History,
    frame: Frame,
    parameters: BmfrParameters = PAPER,
    *,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
) -> tuple[History, Any]:
    """`jflnr.temporal.bmfr.step` on an OpenCL device: same arguments, same result.

    history: from `start` or the frame before, its arrays on the device. The layers of the frame,
    of numpy, JAX or on the device, are read again in the next step and must not change before.
    context, out and on_device: as in `jflnr.opencl.flr`.

    Raises `ValueError` for a layer of the wrong shape; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    bmfr.check(frame)
    output, result = to_output(context, frame.indirect.shape, out, on_device)
    layers = {
        "sample": frame.indirect,
        "motion": bmfr.motion(frame),
        "normal": frame.normal,
        "depth": frame.depth,
        "position": bmfr.position(frame),
        "surface": frame.depth if frame.mask is None else frame.mask,
        "albedo": frame.albedo,
    }
    device = {name: to_device(context, layer) for name, layer in layers.items()}
    following = _step(context, history, parameters, device, frame.position is None, output)
    return following, context.finish(output, result)


def to_device(context: Context, layer: Any) -> Any:
    """A layer as a device array of float32."""
    if is_device_array(layer):
        return layer
    return context.array(np.require(layer, np.float32, ["C", "ALIGNED"]))


def _step(
    context: Context,
    history: History,
    parameters: BmfrParameters,
    layers: dict[str, Any],
    depths: bool,
    image: Any,
) -> History:
    """The three phases; writes `image`. depths: tell surfaces apart by depth."""
    height, width = image.shape[:2]
    size, offset = (width, height), bmfr.grid_offset(history.number, parameters.block)
    light, count, accepted = accumulate_light(
        context, history, layers, parameters.light_share, depths
    )
    fitted = fit(
        context,
        light,
        count,
        layers["surface"],
        (layers["normal"], layers["position"]),
        history.number,
        offset,
        parameters.block,
        parameters.noise,
    )
    mean, picture, shown = (context.empty(image.shape) for _ in range(3))
    arguments = (
        *size, parameters.fitted_share, fitted, layers["albedo"], layers["motion"], accepted, count,
        history.fitted, mean, picture,
    )  # fmt: skip
    context.run("accumulate_fitted", "bmfr/accumulate_fitted.cl", {}, size, arguments)
    share = 1.0 if history.number == 0 else parameters.picture_share
    arguments = (
        *size, share, DARK, picture, history.picture, layers["motion"], layers["albedo"],
        layers["surface"], mean, shown, image,
    )  # fmt: skip
    context.run("taa", "bmfr/taa.cl", {}, size, arguments)
    surface = Surface(layers["normal"], layers["depth"], layers["position"])
    return History(history.number + 1, surface, count, light, mean, shown)


def accumulate_light(
    context: Context, history: History, layers: dict[str, Any], least: float, depths: bool
) -> tuple[Any, Any, Any]:
    """Phase I: mean of the samples at each place; see `jflnr.temporal.bmfr.accumulate_light`.

    Returns the mean `(H, W, 3)`, the number of samples `(H, W, 1)`, and a bit for every accepted
    tap, `(H, W)`.
    """
    height, width = layers["sample"].shape[:2]
    light, count = context.empty((height, width, 3)), context.empty((height, width, 1))
    accepted = context.empty((height, width), np.uint8)
    before = history.surface
    arguments = (
        width, height, OFF_PLANE, SAME_NORMAL, least, layers["sample"], layers["motion"],
        layers["normal"], layers["depth"], layers["position"], before.normal, before.depth,
        before.position, history.count, history.light, light, count, accepted,
    )  # fmt: skip
    defines = {"DEPTHS": 1} if depths else {}
    context.run("accumulate_light", "bmfr/accumulate_light.cl", defines, (width, height), arguments)
    return light, count, accepted
