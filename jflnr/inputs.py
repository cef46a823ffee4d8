"""From a frame to the images that the regressions take."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jflnr import checks
from jflnr import guides as guide_layers
from jflnr.flr.arguments import times_finer
from jflnr.flr.noisy_guides import smooth_guide
from jflnr.frame import Array, Frame


def prepare(frame: Frame, guides: Sequence[str] | None) -> tuple[tuple[str, ...], Frame]:
    """Names of the guides to use, and the checked layers that denoising reads."""
    names = guide_layers.choose(frame, guides)
    inputs = frame_inputs(frame, names)
    _check_sizes(inputs)
    if guides is None and frame.ao is None:
        warnings.warn(
            "The frame has no ao layer, so the guides are normal and depth only; "
            "shadows cast by indirect light may be lost.",
            stacklevel=3,
        )
    if isinstance(frame.indirect, np.ndarray) and not np.isfinite(frame.indirect).any():
        raise ValueError("frame.indirect has no finite value, so there is nothing to denoise")
    return names, inputs


def frame_inputs(frame: Frame, names: Sequence[str]) -> Frame:
    """The frame reduced to the layers that denoising reads, so that others cost nothing."""
    needed = {"indirect", "normal", "depth", "mask", *names}
    unused = {field.name: None for field in dataclasses.fields(Frame) if field.name not in needed}
    return dataclasses.replace(frame, **unused)  # type: ignore[arg-type]


def _check_sizes(frame: Frame) -> None:
    layers = {name: layer for name, layer in vars(frame).items() if name != "indirect"}
    for name, layer in layers.items():
        if layer is not None or name in ("normal", "depth"):
            checks.image(name, layer, 1 if name in ("depth", "ao", "mask") else 3)
    checks.same_size(**layers)
    checks.image("indirect", frame.indirect)
    (height, width), (h, w) = frame.normal.shape[:2], frame.indirect.shape[:2]
    if times_finer((height, width), (h, w)) is None:
        raise ValueError(
            f"frame.indirect is {w} x {h} pixels and the guides are {width} x {height}; "
            "they must be the same, or the guides a whole number of times larger"
        )


def coarse_block(frame: Frame, block: int) -> int:
    """The block in pixels of `frame.indirect`, which may be coarser than the guides."""
    return max(block // factor_of(frame), 1)


def factor_of(frame: Frame) -> int:
    """How many times larger the guides are than the light."""
    return times_finer(frame.normal.shape[:2], frame.indirect.shape[:2]) or 1


def flr_images(
    frame: Frame, names: tuple[str, ...], scene: guide_layers.Scene | None = None
) -> dict[str, Any]:
    """The images that `flr` takes, from the layers of the frame; numpy's stay where they are."""
    target, mask = frame.indirect, frame.mask
    layers = guide_layers.layers(frame, names, scene)
    factor = factor_of(frame)
    if factor == 1:
        weight = None if mask is None else mask[..., 0] > 0
        return {"target": target, "guides": layers, "weight": weight}
    return {
        "target": target,
        "guides": tuple(guide_layers.shrink(layer, factor, mask) for layer in layers),
        "guides_map": layers,
        "weight": None if mask is None else guide_layers.shrink(mask, factor)[..., 0],
    }


def adaptive_images(
    frame: Frame,
    names: tuple[str, ...],
    scene: guide_layers.Scene | None = None,
    smooth: Callable[..., Array] = smooth_guide,
) -> dict[str, Any]:
    """The images that `flr_adaptive` takes: far depths drawn near, ambient occlusion without noise.

    scene: of the frame that this one is a part of; the frame's own if None. smooth: what takes the
    noise from a guide, given the normal and the depth.
    """
    images = flr_images(frame, names, scene)
    layers = dict(zip(names, images["guides"], strict=False))
    if "depth" in layers:
        layers["depth"] = guide_layers.draw_near(layers["depth"])
    if "ao" in layers:
        layers["ao"] = smooth(layers["ao"], frame.normal, frame.depth)
    # Without names there is one layer of no channels.
    images["guides"] = tuple(layers.values()) or images["guides"]
    return images
