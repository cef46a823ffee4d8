"""Denoising frame after frame: one step function for the spatial methods (docs/temporal.md).

The noisy light is averaged over time, the spatial method fits the average, and its results are
averaged again. What the light has become since is found first and added to both averages.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks, flnr
from jflnr.denoising import support_of
from jflnr.flr.adaptive import flr_adaptive, light_of
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.parameters import DEFAULT
from jflnr.flr.regression import flr
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images, prepare
from jflnr.temporal.accumulate import Average, accumulate, nothing, reproject
from jflnr.temporal.change import Change, Evidence, find_change, no_evidence
from jflnr.temporal.reproject import Surface, find_taps

METHODS = ("flr", "flr-adaptive", *flnr.METHODS)


class Temporal(NamedTuple):
    """How the past is kept.

    light: least share of a new frame in the averaged noisy light. image: that of a new fit in the
    averaged result. caution: how many times what noise explains a difference must be, before the
    light is taken to have changed.
    """

    light: float = 0.05
    image: float = 0.3
    caution: float = 3.5


class State(NamedTuple):
    """What one frame leaves to the next, a pytree of arrays.

    surface: what it showed. light: its noisy light, averaged over time. image: so is its result.
    evidence: for a change of the light.
    """

    surface: Surface
    light: Average
    image: Average
    evidence: Evidence


def start(frame: Frame) -> State:
    """The state before the first frame, of which only the shapes count."""
    checks.image("indirect", frame.indirect)
    size = frame.indirect.shape
    surface = jax.tree.map(lambda layer: jnp.zeros(layer.shape), Surface.of(frame))
    return State(surface, nothing(*size), nothing(*size), no_evidence(*size[:2]))


def step(
    state: State,
    frame: Frame,
    method: str = "flr-adaptive",
    *,
    guides: Sequence[str] | None = None,
    parameters: Any = None,
    temporal: Temporal | None = None,
) -> tuple[State, jax.Array]:
    """Denoise the next frame of a sequence.

    state: from `start` or from the frame before. frame: with `motion`; where only the camera moves
    `camera_motion` finds it, and zeros say that nothing does. The first frame's does not count.
    method: one of `METHODS`. guides, parameters: as of `jflnr.denoise`.
    Returns the state for the next frame, and `(H, W, C)`, demodulated indirect radiance.

    Raises `ValueError` or `TypeError` naming the argument.
    """
    names, inputs = prepared(state, frame, method, guides)
    parameters = parameters_of(method, parameters)
    support = support_of(parameters, max(frame.normal.shape)) if method == "flr" else 0
    surface = jax.tree.map(jnp.asarray, Surface.of(frame))
    light, image, evidence = _step(
        state,
        inputs,
        frame.motion,
        surface,
        parameters,
        temporal or Temporal(),
        method,
        names,
        support,
    )
    # The surface and the image twice would be copied if the program returned them.
    return State(surface, light, image, evidence), image.mean


def prepared(
    state: State, frame: Frame, method: str, guides: Sequence[str] | None
) -> tuple[tuple[str, ...], Frame]:
    """Names of the guides, and the layers to denoise, if method, state and frame fit together."""
    checks.choice("method", method, METHODS)
    names, inputs = prepare(frame, guides)
    if frame.motion is None:
        raise ValueError(
            "the frame has no layer motion, so nobody knows where its pixels were one frame ago: "
            "jflnr.temporal.camera_motion finds it from depth and two cameras, and an image of "
            "zeros says that nothing moves"
        )
    checks.image("motion", frame.motion, 2)
    checks.same_size(indirect=frame.indirect, normal=frame.normal, motion=frame.motion)
    if state.light.mean.shape != frame.indirect.shape:
        raise ValueError(
            f"the state is of frames of shape {state.light.mean.shape}, and this frame's indirect "
            f"is {frame.indirect.shape}: a sequence of another size needs a state of its own"
        )
    return names, inputs


def parameters_of(method: str, given: Any) -> Any:
    """The method's parameters, those that are given or else the default."""
    default: Any = DEFAULT if method == "flr" else ADAPTIVE_DEFAULT
    if method in flnr.METHODS:
        from jflnr.flnr import weights

        default = weights.shipped(method)
    if given is not None and type(given) is not type(default):
        raise TypeError(
            f"parameters of method {method} must be {type(default).__name__}; "
            f"got {type(given).__name__}"
        )
    return default if given is None else given


@functools.partial(jax.jit, static_argnames=("method", "names", "support"))
def _step(
    state: State,
    frame: Frame,
    motion: Array,
    surface: Surface,
    parameters: Any,
    temporal: Temporal,
    method: str,
    names: tuple[str, ...],
    support: int,
) -> tuple[Average, Average, Evidence]:
    images = adaptive_images(frame, names)
    guides, mask = images["guides"], images["weight"]
    taps = find_taps(motion, surface, state.surface)
    light, image = reproject(state.light, taps), reproject(state.image, taps)
    known, covered = light.samples[..., 0] > 0, True if mask is None else mask
    change, evidence = find_change(
        jnp.asarray(frame.indirect) - light.mean,
        light_of(image.mean),
        guides,
        jnp.where(known & covered, 1.0, 0.0),
        jnp.where(~known & covered, 1.0, 0.0),
        state.evidence,
        temporal.caution,
    )
    light = accumulate(_changed(light, change), frame.indirect, temporal.light)
    weight = light.samples[..., 0] if mask is None else jnp.where(mask, light.samples[..., 0], 0)
    fitted = _fit(light.mean, guides, weight, parameters, method, support)
    image = accumulate(_changed(image, change), fitted, temporal.image)
    return light, image, evidence


def _changed(average: Average, change: Change) -> Average:
    """An average that follows the light."""
    mean, n = average
    return Average(jnp.where(n > 0, mean + change.signal, 0), n / (1 + change.noise * n))


def _fit(
    target: jax.Array,
    guides: tuple[jax.Array, ...],
    weight: jax.Array,
    parameters: Any,
    method: str,
    support: int,
) -> jax.Array:
    """The spatial method, for which a pixel counts as much as the frames that it has been seen."""
    if method == "flr":
        return flr(target, guides, parameters, weight=weight, support=support)
    if method == "flr-adaptive":
        return flr_adaptive(target, guides, parameters, weight=weight)
    from jflnr.flnr import regression

    return regression.flnr(target, guides, parameters, weight=weight)
