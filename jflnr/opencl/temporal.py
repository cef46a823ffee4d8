"""Denoising with a history on an OpenCL device: the steps of jflnr/temporal/sequence.py."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from jflnr import checks
from jflnr.checks import one_sentence
from jflnr.frame import Frame
from jflnr.opencl import twins
from jflnr.opencl.arguments import to_device, to_layers
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.grids import brightness_defines
from jflnr.opencl.moments import guide_arguments, guide_defines, run_on_rows
from jflnr.opencl.temporal_change import Change, find_change, no_evidence
from jflnr.opencl.temporal_picture import follow
from jflnr.temporal import sequence
from jflnr.temporal.accumulate import Average
from jflnr.temporal.newly_seen import AROUND, BRIGHTER, NEAR
from jflnr.temporal.picture import Past
from jflnr.temporal.reproject import COSINE, OFF_PLANE, SAME_NORMAL, Surface
from jflnr.temporal.sequence import MODEL, PAST, TURNED, State, Temporal


def start(
    frame: Frame,
    method: Any = None,
    *,
    guides: Sequence[str] | None = None,
    context: Context | None = None,
) -> State | Past:
    """`jflnr.temporal.start`, on the device, of one light group."""
    context = default_context() if context is None else context
    checks.image("indirect", frame.indirect, 3)
    like = jax.eval_shape(lambda: sequence.start(frame, method, guides=guides))
    state = jax.tree.map(lambda of: context.array(np.zeros(of.shape, np.float32)), like)
    if isinstance(state, Past):
        return state
    return state._replace(evidence=no_evidence(context, *frame.indirect.shape[:2]))


@one_sentence()
def step(
    state: Any,
    frame: Frame,
    method: Any = None,
    *,
    temporal: Temporal = PAST,
    context: Context | None = None,
    on_device: bool = False,
    guides: Sequence[str] | None = None,
    **options: Any,
) -> tuple[Any, Any]:
    """`jflnr.temporal.step` on an OpenCL device: same arguments, same result.

    state: from `start` or the frame before, its arrays on the device. The layers of the frame are
    read again in the next step and must not change before. context and on_device: as in
    `jflnr.opencl.flr`.

    Raises `ValueError` or `TypeError` naming the argument; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    method, names, inputs = sequence.prepared(state, frame, method, guides, options)
    given = method.images(inputs, names, filters=twins.filters_on(context))
    if isinstance(state, Past):
        found = twins.regress(method, given, context)
        state = follow(context, state, found["image"], found["error"], frame.motion)
        return state, state.picture if on_device else state.picture.get()
    layers = to_layers(context, given["guides"])
    sample, motion = (to_device(context, layer) for layer in (given["target"], frame.motion))
    surface = jax.tree.map(lambda layer: to_device(context, layer), Surface.of(frame))
    weight = frame.depth * 0 + 1 if given["weight"] is None else given["weight"][..., None]
    covered = to_device(context, np.asarray(weight, np.float32))

    light, kept, image, expected, known = reproject(context, state, surface, motion, covered)
    compared = sample, light.mean, expected, known, covered, layers
    change, evidence = find_change(context, *compared, state.evidence, temporal.caution)
    changed = context, change, covered
    light, weight, kept = accumulate(*changed, light, sample, temporal.light, layers, kept)
    images = {"target": light.mean, "guides": kept, "guides_map": layers, "weight": weight}
    fit = twins.regress(method, images, context, on_device=True)["image"]
    new = known, weight, surface.depth
    image, *_ = accumulate(*changed, image, fit, temporal.image, new=new)
    result: Any = image.mean
    context.finish(result, result)
    state = State(surface, light, kept, image, evidence)
    return state, result if on_device else result.get()


def reproject(
    context: Context, state: State, surface: Surface, motion: Any, covered: Any
) -> tuple[Average, Any, Average, Any, Any]:
    """The averages where their pixels are now; brightness of the image there, `(H, W)`; and 1
    where there is a history and something to denoise, else 0, `(H, W)`.

    covered: `(H, W, 1)`, above 0 where there is something to denoise.
    """
    height, width = motion.shape[:2]
    light, image = (_new_average(context, height, width) for _ in range(2))
    expected, known = context.empty((height, width)), context.empty((height, width))
    kept = context.empty(state.guides.shape)
    before = state.surface
    depths = surface.position is None
    # Surfaces without a position are told apart by depth; what stands in its place is not used.
    places = [s.normal if depths else s.position for s in (surface, before)]
    arguments = (
        width, height, OFF_PLANE, SAME_NORMAL, COSINE, motion, surface.normal, surface.depth,
        places[0], before.normal, before.depth, places[1], *TURNED, covered, *state.light,
        state.guides, *state.image, *light, kept, *image, expected, known,
    )  # fmt: skip
    defines = guide_defines((state.guides,), 3) | brightness_defines(3)
    defines |= {"DEPTHS": 1} if depths else {}
    run_on_rows(context, "reproject", "temporal/reproject.cl", defines, arguments)
    return light, kept, image, expected, known


def accumulate(
    context: Context,
    change: Change,
    covered: Any,
    before: Average,
    image: Any,
    least: float,
    guides: tuple[Any, ...] = (),
    kept: Any | None = None,
    new: tuple[Any, ...] = (None, None, None),
) -> tuple[Average, Any, Any]:
    """An average that follows the change, with `image` in it; what its pixels weigh in a fit,
    `(H, W)`; and the average `kept`, `(H, W, Q)`, with `guides`.

    covered: `(H, W, 1)`, what they weigh besides. image: `(H, W, 3)`. least: its share.
    new: what `bounded` of jflnr/temporal/newly_seen.py takes besides the image, if it is to be.
    """
    height, width = image.shape[:2]
    average, weight = _new_average(context, height, width), context.empty((height, width))
    mean = None if kept is None else context.empty(kept.shape)
    lanes = context.width() if height * width >= context.width() else 1
    arguments = (
        height * width, width, least, change.unit, *before, change.signal, change.noise, image,
        covered, kept, *guide_arguments(guides), *new, *average, weight, mean,
    )  # fmt: skip
    defines: dict[str, Any] = {"WIDTH": lanes, "MODEL": f"{MODEL}f"} | guide_defines(guides, 3)
    if new[0] is not None:
        bounds = {"AROUND": AROUND, "NEAR": f"{NEAR}f", "BRIGHTER": f"{BRIGHTER}f"}
        defines |= bounds | brightness_defines(3)
    size, file = (-(-height * width // lanes),), "temporal/accumulate.cl"
    context.run("accumulate", file, defines, size, arguments)
    return average, weight, mean


def _new_average(context: Context, height: int, width: int) -> Average:
    return Average(context.empty((height, width, 3)), context.empty((height, width, 1)))
