"""BMFR on an OpenCL device: host side of kernels_cl/bmfr/; its twin is jflnr/bmfr/pipeline.py."""

from typing import Any, NamedTuple

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
    output, result = to_output(context, frame.indirect.shape, on_device=on_device)
    layers: dict[str, Any] = {
        "sample": frame.indirect,
        "motion": pipeline.motion(frame),
        "normal": frame.normal,
        "depth": frame.depth,
        "position": pipeline.position(frame),
        "surface": pipeline.coverage(frame),
        "albedo": frame.albedo,
    }
    layers = {name: to_device(context, layer) for name, layer in layers.items()}
    now = Step(context, history, layers, method)
    light, count, accepted = accumulate_light(now, depths=frame.position is None)
    fitted = fit(context, light, count, layers, history.number, method)
    mean, picture = accumulate_fitted(now, fitted, count, accepted)
    smooth = taa(now, picture, mean, output)
    surface = Surface(layers["normal"], layers["depth"], layers["position"])
    following = History(history.number + 1, surface, count, light, mean, smooth)
    return following, context.finish(output, result)


class Step(NamedTuple):
    """What the phases of one frame share. layers: of the frame, by name, on the device."""

    context: Context
    history: History
    layers: dict[str, Any]
    method: BMFR

    def run(self, name: str, arguments: tuple[Any, ...], **defines: int | float) -> None:
        """Enqueue kernels_cl/bmfr/`name`.cl on all pixels."""
        height, width = self.layers["motion"].shape[:2]
        features = self.layers["normal"], self.layers["position"]
        given = guide_defines(features, 3) | defines
        run_on_rows(self.context, name, f"bmfr/{name}.cl", given, (width, height, *arguments))


def accumulate_light(now: Step, depths: bool) -> tuple[Any, Any, Any]:
    """Phase I: mean of the samples at each place; see `jflnr.bmfr.pipeline.accumulate_light`.

    depths: tell surfaces apart by depth. Returns the mean `(H, W, 3)`, the number of samples
    `(H, W, 1)`, and a bit for every accepted tap, `(H, W)`.
    """
    context, history, layers, method = now
    size, before = layers["sample"].shape[:2], history.surface
    light, count = context.empty((*size, 3)), context.empty((*size, 1))
    accepted = context.empty(size, np.uint8)
    arguments = (
        OFF_PLANE, SAME_NORMAL, COSINE, layers["motion"], layers["normal"], layers["depth"],
        layers["position"], before.normal, before.depth, before.position, method.light_share,
        layers["sample"], layers["surface"], history.samples, history.light, light, count, accepted,
    )  # fmt: skip
    defines = {"DEPTHS": 1} if depths else {}
    now.run("accumulate_light", arguments, MOST=pipeline.MOST_SAMPLES, **defines)
    return light, count, accepted


def accumulate_fitted(now: Step, fitted: Any, count: Any, accepted: Any) -> tuple[Any, Any]:
    """Phase III: mean of the fitted light, `(H, W, 3)`, and that times albedo, `(3, H, W)`."""
    context, history, layers, method = now
    mean, picture = context.empty(fitted.shape), context.empty((3, *fitted.shape[:2]))
    arguments = (
        method.fitted_share, fitted, layers["albedo"], layers["motion"], accepted, count,
        history.fitted, mean, picture,
    )  # fmt: skip
    now.run("accumulate_fitted", arguments, WHITEST=WHITEST)
    return mean, picture


def taa(now: Step, picture: Any, mean: Any, image: Any) -> Any:
    """Phase III: the smoothed picture, `(H, W, 3)`; writes `image`, the same without albedo."""
    context, history, layers, method = now
    smooth = context.empty(mean.shape)
    arguments = (
        method.picture_share, DARK, picture, history.picture, history.samples, layers["motion"],
        layers["albedo"], layers["surface"], mean, smooth, image,
    )  # fmt: skip
    now.run("taa", arguments, WHITEST=WHITEST)
    return smooth
