"""BMFR on an OpenCL device: host side of kernels_cl/bmfr/; its twin is jflnr/bmfr/pipeline.py."""

from typing import Any

import numpy as np

from jflnr.bmfr import pipeline
from jflnr.bmfr.pipeline import BMFR, DARK, PAPER, WHITEST, History
from jflnr.checks import one_sentence
from jflnr.frame import Frame
from jflnr.opencl.arguments import to_device, to_output
from jflnr.opencl.bmfr_fit import fit
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.moments import guide_defines, run_on_rows
from jflnr.temporal.reproject import COSINE, OFF_PLANE, SAME_NORMAL, Surface


def start(frame: Frame, context: Context | None = None) -> History:
    """`jflnr.bmfr.pipeline.start`, on the device."""
    context = default_context() if context is None else context
    size = frame.normal.shape[:2]
    zeros = lambda channels: context.array(np.zeros((*size, channels), np.float32))
    surface = Surface(zeros(3), zeros(1), None if frame.position is None else zeros(3))
    return History(0, surface, zeros(1), zeros(3), zeros(3), zeros(3))


@one_sentence()
def step(
    history: History,
    frame: Frame,
    method: BMFR = PAPER,
    *,
    context: Context | None = None,
    on_device: bool = False,
) -> tuple[History, Any]:
    """`jflnr.bmfr.pipeline.step` on an OpenCL device: same arguments, same result.

    history: from `start` or the frame before, its arrays on the device. The layers of the frame,
    of numpy, JAX or on the device, are read again in the next step and must not change before.
    context and on_device: as in `jflnr.opencl.flr`.

    Raises `ValueError` for a layer of the wrong shape; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    pipeline.check(frame)
    height, width = frame.indirect.shape[:2]
    output, result = to_output(context, (height, width, 3), None, on_device)
    layers: dict[str, Any] = {
        "sample": frame.indirect,
        "motion": pipeline.motion(frame),
        "normal": frame.normal,
        "depth": frame.depth,
        "position": pipeline.position(frame),
        "surface": frame.depth if frame.mask is None else frame.mask,
        "albedo": frame.albedo,
    }
    layers = {name: to_device(context, layer) for name, layer in layers.items()}
    depths = frame.position is None
    light, count, accepted = accumulate_light(context, history, layers, method, depths)
    fitted = fit(context, light, count, layers, history.number, method.block, method.noise)
    mean, picture = accumulate_fitted(context, history, layers, method, fitted, count, accepted)
    smooth = taa(context, history, layers, method, picture, mean, output)
    surface = Surface(layers["normal"], layers["depth"], layers["position"])
    following = History(history.number + 1, surface, count, light, mean, smooth)
    return following, context.finish(output, result)


def accumulate_light(
    context: Context, history: History, layers: dict[str, Any], method: BMFR, depths: bool
) -> tuple[Any, Any, Any]:
    """Phase I: mean of the samples at each place; see `jflnr.bmfr.pipeline.accumulate_light`.

    depths: tell surfaces apart by depth. Returns the mean `(H, W, 3)`, the number of samples
    `(H, W, 1)`, and a bit for every accepted tap, `(H, W)`.
    """
    height, width = layers["sample"].shape[:2]
    light, count = context.empty((height, width, 3)), context.empty((height, width, 1))
    accepted = context.empty((height, width), np.uint8)
    before = history.surface
    arguments = (
        OFF_PLANE, SAME_NORMAL, COSINE, layers["motion"], layers["normal"], layers["depth"],
        layers["position"], before.normal, before.depth, before.position, method.light_share,
        layers["sample"], layers["surface"], history.samples, history.light, light, count, accepted,
    )  # fmt: skip
    defines = {"MOST": pipeline.MOST_SAMPLES} | ({"DEPTHS": 1} if depths else {})
    run(context, "accumulate_light", layers, arguments, defines)
    return light, count, accepted


def accumulate_fitted(
    context: Context,
    history: History,
    layers: dict[str, Any],
    method: BMFR,
    fitted: Any,
    count: Any,
    accepted: Any,
) -> tuple[Any, Any]:
    """Phase III: mean of the fitted light, `(H, W, 3)`, and that times albedo, `(3, H, W)`."""
    height, width = fitted.shape[:2]
    mean, picture = context.empty(fitted.shape), context.empty((3, height, width))
    arguments = (
        method.fitted_share, fitted, layers["albedo"], layers["motion"], accepted, count,
        history.fitted, mean, picture,
    )  # fmt: skip
    run(context, "accumulate_fitted", layers, arguments, {"WHITEST": WHITEST})
    return mean, picture


def taa(
    context: Context,
    history: History,
    layers: dict[str, Any],
    method: BMFR,
    picture: Any,
    mean: Any,
    image: Any,
) -> Any:
    """Phase III: the smoothed picture, `(H, W, 3)`; writes `image`, the same without albedo."""
    smooth = context.empty(mean.shape)
    arguments = (
        method.picture_share, DARK, picture, history.picture, history.samples, layers["motion"],
        layers["albedo"], layers["surface"], mean, smooth, image,
    )  # fmt: skip
    run(context, "taa", layers, arguments, {"WHITEST": WHITEST})
    return smooth


def run(
    context: Context,
    name: str,
    layers: dict[str, Any],
    arguments: tuple[Any, ...],
    defines: dict[str, Any] | None = None,
) -> None:
    """Enqueue kernels_cl/bmfr/`name`.cl on all pixels."""
    height, width = layers["motion"].shape[:2]
    defines = guide_defines((layers["normal"], layers["position"]), 3) | (defines or {})
    run_on_rows(context, name, f"bmfr/{name}.cl", defines, (width, height, *arguments))
