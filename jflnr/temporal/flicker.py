"""How much light changes along its surfaces from frame to frame: what flickers, and what truly
changes."""

from __future__ import annotations

import jax
import numpy as np

from jflnr import checks
from jflnr.frame import Array, Frame
from jflnr.metrics import display, reflected
from jflnr.temporal.reproject import Surface, Taps, find_taps, gather

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

_find_taps = jax.jit(find_taps)


def warped_error(frames: tuple[Frame, Frame], lights: tuple[Array, Array], scale: float) -> float:
    """Mean absolute difference of the luminance of adjacent pictures, as displayed, with the light
    of the first frame moved to where its surfaces are in the second.

    Of the pixels that both frames show; NaN if there are none. Both lights are multiplied by the
    second frame's albedo, so that neither motion nor the resampling of a texture counts; of other
    programs' pictures that resampling does. lights: `(H, W, 3)` of each frame, demodulated, or
    pictures. scale: the exposure of the whole sequence. Raises ValueError without motion.
    """
    change = warped_change(frames, lights, scale)
    return float(np.mean(np.abs(change))) if change.size else float("nan")


def warped_change(
    frames: tuple[Frame, Frame], lights: tuple[Array, Array], scale: float
) -> np.ndarray:
    """The changes that `warped_error` is the mean of, with their sign, `(n,)`."""
    before, now = frames
    taps = taps_between(before, now)
    seen = np.asarray(taps.seen)[..., 0]
    if now.mask is not None:
        seen = seen & (np.asarray(now.mask)[..., 0] > 0)
    moved = np.asarray(gather(taps, np.asarray(lights[0], np.float32)))
    return (luminance(now, lights[1], scale) - luminance(now, moved, scale))[seen]


def taps_between(before: Frame, now: Frame) -> Taps:
    """Where the pixels of a frame were in the one before. Raises ValueError without motion."""
    if now.motion is None:
        raise ValueError("the frame has no layer motion, so it cannot be compared with the last")
    checks.same_size(before=before.normal, now=now.normal)
    return _find_taps(now.motion, Surface.of(now), Surface.of(before))


def luminance(frame: Frame, light: Array, scale: float) -> np.ndarray:
    """That of the displayed picture, `(H, W)`."""
    return display(reflected(frame, light), scale) @ LUMINANCE
