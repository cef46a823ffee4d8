"""Denoising frame after frame: the one step function of the spatial methods (docs/temporal.md)."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks
from jflnr.denoising import support_of
from jflnr.flr.adaptive import flr_adaptive
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.flr.parameters import DEFAULT, Parameters
from jflnr.flr.regression import flr
from jflnr.frame import Frame
from jflnr.inputs import adaptive_images, flr_images, prepare
from jflnr.temporal.accumulate import Average, accumulate, nothing, reproject
from jflnr.temporal.reproject import Surface, find_taps

METHODS = ("flr", "flr-adaptive")


class Temporal(NamedTuple):
    """How much of the past is kept.

    light: least share of a new frame in the accumulated noisy light. image: that of a new fit in
    the result.
    """

    light: jax.Array | float = 0.05
    image: jax.Array | float = 0.3


class State(NamedTuple):
    """What one frame leaves to the next.

    surface: what it showed. light: its noisy light, averaged over time. image: its result.
    """

    surface: Surface
    light: Average
    image: Average


def start(frame: Frame) -> State:
    """The state before the first frame, of which only the shapes count."""
    size = frame.indirect.shape
    surface = jax.tree.map(lambda layer: jnp.zeros(layer.shape), Surface.of(frame))
    return State(surface, nothing(*size), nothing(*size))


def step(
    state: State,
    frame: Frame,
    method: str = "flr-adaptive",
    *,
    guides: Sequence[str] | None = None,
    parameters: Parameters | AdaptiveParameters | None = None,
    temporal: Temporal | None = None,
) -> tuple[State, jax.Array]:
    """Denoise the next frame of a sequence.

    state: from `start` or from the frame before. frame: with `motion`; `camera_motion` gives it
    where only the camera moves, and zeros say that nothing does. method: `flr` or `flr-adaptive`.
    guides, parameters: as of `jflnr.denoise`.
    Returns the state for the next frame, and `(H, W, C)`, demodulated indirect radiance.

    Raises `ValueError` or `TypeError` naming the argument.
    """
    checks.choice("method", method, METHODS)
    names, inputs = prepare(frame, guides)
    motion = _motion_of(frame)
    checks.same_size(
        motion=motion, indirect=frame.indirect, normal=frame.normal, state=state.light.mean
    )
    default: Any = ADAPTIVE_DEFAULT if method == "flr-adaptive" else DEFAULT
    parameters = default if parameters is None else parameters
    support = (
        support_of(parameters, max(motion.shape[:2])) if isinstance(parameters, Parameters) else 1
    )
    return _step(
        state, inputs, motion, Surface.of(frame), parameters, temporal or Temporal(), names, support
    )


def _motion_of(frame: Frame) -> Any:
    if frame.motion is None:
        raise ValueError(
            "the frame has no layer motion, so it is not known where its pixels were one frame "
            "ago: jflnr.temporal.camera_motion finds it from depth and two cameras, and an image "
            "of zeros says that nothing moves"
        )
    checks.image("motion", frame.motion, 2)
    return frame.motion


@functools.partial(jax.jit, static_argnames=("names", "support"))
def _step(
    state: State,
    frame: Frame,
    motion: jax.Array,
    surface: Surface,
    parameters: Any,
    temporal: Temporal,
    names: tuple[str, ...],
    support: int,
) -> tuple[State, jax.Array]:
    taps = find_taps(motion, surface, state.surface)
    light = accumulate(reproject(state.light, taps), frame.indirect, temporal.light)
    fitted = _fit(
        dataclasses.replace(frame, indirect=light.mean), light.samples, parameters, names, support
    )
    image = accumulate(reproject(state.image, taps), fitted, temporal.image)
    return State(surface, light, image), image.mean


def _fit(
    frame: Frame, samples: jax.Array, parameters: Any, names: tuple[str, ...], support: int
) -> jax.Array:
    """The spatial method, where a pixel weighs as much as the frames it has seen."""
    adaptive = isinstance(parameters, AdaptiveParameters)
    images = (adaptive_images if adaptive else flr_images)(frame, names)
    there = images.pop("weight")
    weight = samples[..., 0] if there is None else jnp.where(there, samples[..., 0], 0)
    if adaptive:
        return flr_adaptive(parameters=parameters, weight=weight, **images)
    return flr(parameters=parameters, weight=weight, support=support, **images)
