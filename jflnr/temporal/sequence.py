"""Denoising frame after frame: one step function for all spatial methods (docs/temporal.md).

Whole pictures are denoised by themselves, and averaged then (`picture.py`). Of light the noisy one
is averaged over time, and with it the guides, which say of what surfaces it is. The spatial method
fits one to the other and evaluates the fit at this frame's guides; its results are averaged again.
What the light has become since is found first and added to both averages.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks
from jflnr.frame import Array, Frame
from jflnr.images.inputs import guides_of, prepare
from jflnr.methods import default_of, method_of
from jflnr.regression.adaptive import light_of
from jflnr.regression.arguments import channel_count, layers_of
from jflnr.regression.picture import WholePicture
from jflnr.stages import regress
from jflnr.temporal import picture
from jflnr.temporal.accumulate import Average, accumulate, less_sure, nothing, reproject
from jflnr.temporal.change import Change, Evidence, find_change, no_evidence
from jflnr.temporal.newly_seen import bounded
from jflnr.temporal.reproject import Surface, find_taps, own_turn

# Variances of one frame that the averaged light and the averaged result, which has less noise, take
# on by the squared turn of their surface: what falls on it depends on where it faces.
TURNED = 8.0, 60.0
# How wrong a model is, in variances of one frame, however many frames its pixels hold.
MODEL = 1.0


class Temporal(NamedTuple):
    """How the past is kept.

    light: least share of a new frame in the averaged noisy light. image: that of a new fit in the
    averaged result. caution: how many times what noise explains a difference must be, before the
    light is taken to have changed.
    """

    light: float = 0.05
    image: float = 0.3
    caution: float = 3.5


PAST = Temporal()


class State(NamedTuple):
    """What one frame leaves to the next, a pytree of arrays.

    surface: what it showed. light: its noisy light, averaged over time. guides: `(H, W, Q)`, so are
    they, with the same shares. image: and its result. evidence: for a change of the light.
    """

    surface: Surface
    light: Average
    guides: Array
    image: Average
    evidence: Evidence


def start(
    frame: Frame, method: Any = None, *, guides: Sequence[str] | None = None
) -> State | picture.Past:
    """The state before the first frame, of which only the shapes count. Arguments as of `step`.

    Returns a `State`, or of a method of whole pictures a `picture.Past`.
    """
    checks.image("indirect", frame.indirect)
    method = named(frame, method)
    if isinstance(method, WholePicture):
        return picture.nothing(frame)
    height, width, channels = frame.indirect.shape
    surface = jax.tree.map(lambda layer: jnp.zeros(layer.shape), Surface.of(frame))
    light, image = (nothing(height, width, channels) for _ in range(2))
    nowhere = jnp.zeros((height, width, guide_count(frame, method, guides)))
    return State(surface, light, nowhere, image, no_evidence(height, width))


def guide_count(frame: Frame, method: Any, guides: Sequence[str] | None) -> int:
    """Channels of the guides that a method takes of a frame."""
    return channel_count([getattr(frame, name) for name in guides_of(frame, guides, method)])


def named(frame: Frame, method: Any, **options: Any) -> Any:
    """The method that is meant for a frame."""
    return method_of(default_of(frame) if method is None else method, **options)


def step(
    state: Any,
    frame: Frame,
    method: Any = None,
    *,
    guides: Sequence[str] | None = None,
    temporal: Temporal = PAST,
    **options: Any,
) -> tuple[Any, jax.Array]:
    """Denoise the next frame of a sequence.

    state: from `start` or from the frame before. frame: with `motion`; where only the camera moves
    `camera_motion` finds it, and zeros say that nothing does. The first frame's does not count.
    method, guides, options: as of `jflnr.denoise`; a method that has stages. temporal: of light.
    Returns the state for the next frame, and `(H, W, C)`, what `jflnr.denoise` does.

    Raises `ValueError` or `TypeError` naming the argument.
    """
    method, names, inputs = prepared(state, frame, method, guides, options)
    if isinstance(state, picture.Past):
        past = _picture_step(state, inputs, frame.motion, method, names)
        return past, past.picture
    surface = jax.tree.map(jnp.asarray, Surface.of(frame))
    found = _step(state, inputs, frame.motion, surface, method, temporal, names)
    light, kept, image, evidence = found
    # The surface and the image twice would be copied if the program returned them.
    return State(surface, light, kept, image, evidence), image.mean


def prepared(
    state: Any, frame: Frame, method: Any, guides: Sequence[str] | None, options: dict[str, Any]
) -> tuple[Any, tuple[str, ...], Frame]:
    """The method for the frame, names of the guides and the layers to denoise, if all of it and the
    state fit together."""
    method = named(frame, method, **options)
    if not hasattr(method, "stages"):
        raise ValueError(f"method {method.name} denoises frames by themselves, not over time")
    names, inputs = prepare(frame, guides, method)
    if frame.motion is None:
        raise ValueError(
            "the frame has no layer motion, so nobody knows where its pixels were one frame ago: "
            "jflnr.temporal.camera_motion finds it from depth and two cameras, and an image of "
            "zeros says that nothing moves"
        )
    checks.image("motion", frame.motion, 2)
    checks.same_size(indirect=frame.indirect, normal=frame.normal, motion=frame.motion)
    pictures = isinstance(method, WholePicture)
    if pictures != isinstance(state, picture.Past):
        raise ValueError(f"the state is not of method {method.name}: start with the same method")
    before = (state.picture if pictures else state.light.mean).shape
    if before != (wanted := picture.shape_of(frame) if pictures else frame.indirect.shape):
        raise ValueError(
            f"the state is of frames of shape {before}, and this one is {wanted}: a sequence of "
            "another size needs a state of its own"
        )
    if pictures:
        method = dataclasses.replace(method, with_error=True, lobes=False)
    elif (count := guide_count(frame, method, guides)) != state.guides.shape[2]:
        raise ValueError(
            f"the state is of {state.guides.shape[2]} channels of guides, and method {method.name} "
            f"takes {count} of this frame: start with the same method and guides"
        )
    return method.for_frame(inputs, names), names, inputs


@functools.partial(jax.jit, static_argnames="names")
def _step(
    state: State,
    frame: Frame,
    motion: Array,
    surface: Surface,
    method: Any,
    temporal: Temporal,
    names: tuple[str, ...],
) -> tuple[Average, jax.Array, Average, Evidence]:
    images = method.images(frame, names)
    target, weight = jnp.asarray(images["target"]), images["weight"]
    channels = target.shape[-1]
    taps = find_taps(motion, surface, state.surface)
    turn, averages = own_turn(taps, surface, state.surface), (_with_guides(state), state.image)
    light, image = (
        less_sure(reproject(average, taps), turned * turn)
        for average, turned in zip(averages, TURNED, strict=True)
    )
    known, covered = light.samples[..., 0] > 0, True if weight is None else weight > 0
    compared = target - light.mean[..., :channels], light_of(image.mean), images["guides"]
    old, new = (jnp.where(there & covered, 1.0, 0.0) for there in (known, ~known))
    change, evidence = find_change(*compared, old, new, state.evidence, temporal.caution)
    pixels = jnp.concatenate([target, *layers_of(images["guides"])], axis=-1)
    light = accumulate(_changed(light, change), pixels, temporal.light)
    # The more frames a pixel holds the more it counts, until the model is what is wrong.
    count = light.samples[..., 0]
    weight = (1 + MODEL) * count / (1 + MODEL * count) * (1 if weight is None else weight)
    images |= {"target": light.mean[..., :channels], "weight": weight}
    mapped = {"guides": light.mean[..., channels:], "guides_map": images["guides"]}
    fitted = regress(method, images | mapped)
    fit = bounded(fitted["image"], known & covered, weight, surface.depth)
    image = accumulate(_changed(image, change), fit, temporal.image)
    return Average(images["target"], light.samples), mapped["guides"], image, evidence


@functools.partial(jax.jit, static_argnames="names")
def _picture_step(
    past: picture.Past, frame: Frame, motion: Array, method: Any, names: tuple[str, ...]
) -> picture.Past:
    given = regress(method, method.images(frame, names))
    return picture.follow(past, given["image"], given["error"], motion)


def _with_guides(state: State) -> Average:
    """The averaged light, and behind it the guides."""
    light, samples = state.light
    return Average(jnp.concatenate([light, state.guides], axis=-1), samples)


def _changed(average: Average, change: Change) -> Average:
    """An average that follows the light."""
    mean, n = average
    # Behind the light there may be guides, which stay.
    signal = jnp.pad(change.signal, [(0, 0), (0, 0), (0, mean.shape[2] - change.signal.shape[2])])
    return less_sure(Average(jnp.where(n > 0, mean + signal, 0), n), change.noise)
