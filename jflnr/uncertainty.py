"""From a frame to denoised light and how far it may be from the truth."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import jax

from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.flr.uncertainty import flr_adaptive_with_error
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images, prepare


def denoise_with_error(
    frame: Frame,
    *,
    guides: Sequence[str] | None = None,
    parameters: AdaptiveParameters | None = None,
) -> tuple[Array, Array]:
    """What `denoise(frame, "flr-adaptive")` gives, and its standard error (docs/adaptive.md).

    No reference is needed. About nine pixels of ten are within 1.645 standard errors of the truth.
    frame, guides, parameters: as of `denoise`.
    Returns `(H, W, C)` and `(H, W, 1)`, the standard error of the image's brightness (luminance;
    the sum of the channels where they are not colours).

    Raises `ValueError` or `TypeError` as `denoise` does.
    """
    names, inputs = prepare(frame, guides)
    if inputs.indirect.shape[:2] != inputs.normal.shape[:2]:
        raise ValueError("an error map needs frame.indirect at the size of the guides")
    settings = ADAPTIVE_DEFAULT if parameters is None else parameters
    return _denoise_with_error(inputs, settings, names)


@functools.partial(jax.jit, static_argnames=("names",))
def _denoise_with_error(
    frame: Frame, parameters: AdaptiveParameters, names: tuple[str, ...]
) -> tuple[jax.Array, jax.Array]:
    return flr_adaptive_with_error(parameters=parameters, **adaptive_images(frame, names))
