"""From a frame to denoised light: the one call most people need."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jflnr import checks, flnr
from jflnr import guides as guide_layers
from jflnr.flr.adaptive import flr_adaptive
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.flr.parameters import DEFAULT, Parameters
from jflnr.flr.regression import flr
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images, coarse_block, factor_of, flr_images, prepare

# Pixels on a side that share one model: the size the paper found to lose nothing.
BLOCK = 8
METHODS = ("flr", "flr-adaptive", *flnr.METHODS, "bmfr", "auto")
SHIPPED_FRAME = Path(__file__).parent / "data" / "room.exr"
BACKENDS = ("jax", "opencl")


def denoise(
    frame: Frame,
    method: str = "flr",
    *,
    backend: str = "jax",
    guides: Sequence[str] | None = None,
    parameters: Parameters | AdaptiveParameters | dict[str, Any] | None = None,
    block: int = BLOCK,
    keep_energy: bool = False,
    tile: int | None = None,
) -> Array:
    """Denoise the indirect light of a frame.

    frame: as from `read_frame`. Its `indirect` may have any number of channels C: several light
    groups side by side are denoised together, and their results sum to the denoised sum. It may
    also be smaller than the other layers by a whole factor; the result then has their size.
    method: `flr` (section 3.2 of the paper), `flr-adaptive` (docs/adaptive.md), `flnr`, the same
    steered by a network, `flnr-small` or `flnr-tiny`, by a smaller one (docs/flnr.md), `bmfr`, as
    in the first frame of a sequence (docs/bmfr.md), which takes neither guides nor any of the
    options below, or `auto`, the smallest model that is good enough for the frame
    (docs/select.md).
    guides: names out of normal, depth, ao, position, albedo; by default normal, depth and, where
    the frame has it, ao. parameters: of the method, for flnr weights from `flnr.weights.load`; the
    fitted defaults if None.
    block: pixels on a side that share one model.
    keep_energy: except for `flr`, keep the mean radiance exactly instead of nearly.
    tile: work on about `tile` x `tile` pixels at a time, with the same result in less memory
    (docs/large.md); on all of them if None.
    Pixels outside `frame.mask`, and any with a NaN or infinity, are left out of the fit.
    Returns `(H, W, C)` float32, demodulated indirect radiance.

    Raises `ValueError` or `TypeError` naming the argument, also if no pixel can be used. Warns if
    the frame has no ambient occlusion.
    """
    checks.choice("method", method, METHODS)
    checks.choice("backend", backend, BACKENDS)
    checks.positive_integer("block", block)
    if method == "bmfr":
        if guides is not None or block != BLOCK or keep_energy or tile is not None:
            raise ValueError(
                "method bmfr has its own features and blocks; guides, block, keep_energy and tile "
                "are for other methods"
            )
        prepare(frame, ("normal", "depth"))
        return _denoise_bmfr(frame, parameters, backend)
    names, inputs = prepare(frame, guides)
    if method == "auto":
        if backend != "jax" or block != BLOCK or tile is not None or parameters is not None:
            raise ValueError(
                "method auto finds its own block and parameters, and runs on the jax backend, in "
                "one piece; flr and flr-adaptive also run on opencl and in tiles"
            )
        from jflnr.selection.method import select_inputs
        from jflnr.selection.plan import Limits

        return select_inputs(inputs, names, Limits(), keep_energy)[1]
    if method in flnr.METHODS:
        if block != BLOCK:
            raise ValueError(f"method {method} works with block {BLOCK} only; got {block}")
        from jflnr.flnr.method import denoise_flnr
        from jflnr.flnr.weights import shipped

        settings = _parameters(parameters, {}) if parameters is not None else shipped(method)
        if tile is None:
            return denoise_flnr(
                inputs, method, settings, names=names, keep_energy=keep_energy, backend=backend
            )
    elif method == "flr-adaptive":
        settings = _parameters(parameters, ADAPTIVE_DEFAULT)
        if inputs.indirect.shape[:2] != inputs.normal.shape[:2]:
            raise ValueError("method flr-adaptive needs frame.indirect at the size of the guides")
        if tile is None:
            run = _denoise_adaptive if backend == "jax" else _denoise_adaptive_opencl
            return run(inputs, settings, names, block, keep_energy)
    else:
        settings = _parameters(parameters, DEFAULT)
        if tile is None:
            return denoise_flr(inputs, settings, names, block, backend)
    if backend != "jax" and method != "flr":
        raise ValueError(f"method {method} works in tiles on the jax backend only")
    from jflnr.large import strips

    checks.positive_integer("tile", tile)
    rows = strips.rows_of(inputs)
    options = strips.Options(method, settings, names, block, backend, keep_energy)
    return np.concatenate([strip for _, strip in strips.denoise(rows, options, tile)])


class Part(NamedTuple):
    """What a part of a frame takes from the whole: how far its windows reach, and what `layers` and
    `flr` would else find for themselves."""

    support: int
    scene: guide_layers.Scene | None = None
    shift: jax.Array | None = None


def denoise_flr(
    frame: Frame,
    parameters: Parameters,
    names: tuple[str, ...],
    block: int,
    backend: str,
    part: Part | None = None,
) -> Array:
    """Method `flr`, of a frame or of a part of one."""
    if part is None:
        height, width = frame.normal.shape[:2]
        part = Part(support_of(parameters, max(height, width)))
        if (height % block or width % block) and factor_of(frame) == 1 and _is_numpy(frame):
            # Sizes that differ by less than a block share a program. NaN counts for nothing.
            part, padded = part._replace(scene=guide_layers.scene_of(frame)), _pad(frame, block)
            return denoise_flr(padded, parameters, names, block, backend, part)[:height, :width]
    if backend == "opencl":
        from jflnr import opencl

        images, block = flr_images(frame, names, part.scene), coarse_block(frame, block)
        return opencl.flr(parameters=parameters, block=block, support=part.support, **images)
    return _denoise(frame, parameters, names, block, *part)


def _is_numpy(frame: Frame) -> bool:
    return all(isinstance(layer, np.ndarray) for layer in jax.tree.leaves(frame))


def _pad(frame: Frame, block: int) -> Frame:
    """The frame with NaN below and to the right, up to whole blocks."""

    def pad(layer: np.ndarray) -> np.ndarray:
        margins = [(0, -size % block) for size in layer.shape[:2]]
        return np.pad(layer, [*margins, (0, 0)], constant_values=np.nan)

    return jax.tree.map(pad, frame)


def _denoise_bmfr(frame: Frame, parameters: Any, backend: str) -> Array:
    from jflnr.temporal import bmfr

    parameters = _parameters(parameters, bmfr.PAPER)
    if backend == "opencl":
        from jflnr.opencl import bmfr as kernels

        return kernels.step(kernels.start(frame), frame, parameters)[1]
    return bmfr.step(bmfr.start(frame), frame, parameters)[1]


def _parameters(given: Any, default: Any) -> Any:
    if given is not None and type(given) is not type(default):
        raise TypeError(
            f"parameters must be {type(default).__name__} for this method; "
            f"got {type(given).__name__}"
        )
    return default if given is None else given


def support_of(parameters: Parameters, longest: int) -> int:
    """Three standard deviations, in steps of 24 pixels so that few programs are compiled.

    No farther than the frame's longest side, whatever a parameter file says.
    """
    if isinstance(parameters.log_sigma, jax.core.Tracer):
        return 72
    reach = min(3 * math.exp(float(parameters.log_sigma)), longest)
    return 24 * max(int(np.ceil(reach / 24)), 1)


@functools.partial(jax.jit, static_argnames=("names", "block", "support"))
def _denoise(
    frame: Frame,
    parameters: Parameters,
    names: tuple[str, ...],
    block: int,
    support: int,
    scene: guide_layers.Scene | None,
    shift: jax.Array | None,
) -> jax.Array:
    images, block = flr_images(frame, names, scene), coarse_block(frame, block)
    return flr(parameters=parameters, block=block, support=support, shift=shift, **images)


@functools.partial(jax.jit, static_argnames=("names", "block", "keep_energy"))
def _denoise_adaptive(
    frame: Frame,
    parameters: AdaptiveParameters,
    names: tuple[str, ...],
    block: int,
    keep_energy: bool,
) -> jax.Array:
    images = adaptive_images(frame, names)
    return flr_adaptive(parameters=parameters, block=block, keep_energy=keep_energy, **images)


def _denoise_adaptive_opencl(
    frame: Frame,
    parameters: AdaptiveParameters,
    names: tuple[str, ...],
    block: int,
    keep_energy: bool,
) -> np.ndarray:
    from jflnr import opencl

    images = adaptive_images(frame, names, smooth=opencl.smooth_guide)
    return opencl.flr_adaptive(
        parameters=parameters, block=block, keep_energy=keep_energy, **images
    )
