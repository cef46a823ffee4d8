"""The images that a regression takes: the light, the guides, and which pixels count."""

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from jflnr import checks
from jflnr.frame import Frame
from jflnr.images import guides as guide_layers
from jflnr.images.guides import FILTERS, Filters
from jflnr.layouts import LAYERS, PICTURE


def prepare(
    frame: Frame, guides: Sequence[str] | None, method: Any
) -> tuple[tuple[str, ...], Frame]:
    """Names of the guides to use, and the checked layers that denoising reads.

    Raises `ValueError` or `TypeError` naming the argument. Warns if the frame has no occlusion.
    """
    names = names_of(frame, guides, method)
    inputs = frame_inputs(frame, names)
    _check_sizes(inputs)
    warn_without_ao(frame, guides, method)
    # Most often the first rows tell.
    light = frame.indirect
    if isinstance(light, np.ndarray) and not any(np.isfinite(a).any() for a in (light[:8], light)):
        raise ValueError("frame.indirect has no finite value, so there is nothing to denoise")
    return names, inputs


def names_of(frame: Frame, guides: Sequence[str] | None, method: Any) -> tuple[str, ...]:
    """The layers that a method reads besides light: its own, where they are there, or guides."""
    own = getattr(method, "features", None)
    if own is None:
        return guide_layers.choose(frame, guides)
    return tuple(name for name in own if getattr(frame, name) is not None)


def guides_of(frame: Frame, guides: Sequence[str] | None, method: Any) -> list[str]:
    """Those of the layers that a method reads that it takes for guides."""
    own = getattr(method, "guides", None)
    return [name for name in names_of(frame, guides, method) if own is None or name in own]


def warn_without_ao(frame: Frame, guides: Sequence[str] | None, method: Any) -> None:
    """Warn if a guide is not there that nobody has left out, and that there might be."""
    own = hasattr(method, "features") or frame.beauty is not None
    if guides is None and frame.ao is None and not own:
        warnings.warn(
            "The frame has no ao layer, so the guides are normal and depth only; "
            "shadows cast by indirect light may be lost.",
            stacklevel=5,
        )


def frame_inputs(frame: Frame, names: Sequence[str]) -> Frame:
    """The frame reduced to the layers that denoising reads, so that others cost nothing."""
    unused = frame.layers().keys() - {"indirect", "normal", "depth", "mask", *names}
    return dataclasses.replace(frame, **dict.fromkeys(unused))  # type: ignore[arg-type]


def _check_sizes(frame: Frame) -> None:
    layers = {"normal": frame.normal, "depth": frame.depth} | frame.layers()
    layers.pop("indirect", None)
    for name, layer in layers.items():
        checks.image(name, layer, len((LAYERS | PICTURE)[name]) or None)
    checks.same_size(**layers)
    checks.image("indirect", frame.indirect)
    (height, width), (h, w) = frame.normal.shape[:2], frame.indirect.shape[:2]
    if checks.times_finer((height, width), (h, w)) is None:
        raise ValueError(
            f"frame.indirect is {w} x {h} pixels and the guides are {width} x {height}; "
            "they must be the same, or the guides a whole number of times larger"
        )


def factor_of(frame: Frame) -> int:
    """How many times larger the guides are than the light."""
    return checks.times_finer(frame.normal.shape[:2], frame.indirect.shape[:2]) or 1


def same_size(frame: Frame, method: str) -> None:
    """Raise `ValueError` unless the light has the size of the guides, as `method` needs it."""
    if frame.indirect.shape[:2] != frame.normal.shape[:2]:
        raise ValueError(f"method {method} needs frame.indirect at the size of the guides")


def plain_images(
    frame: Frame,
    names: tuple[str, ...],
    scene: guide_layers.Scene | None = None,
    filters: Filters = FILTERS,
) -> dict[str, Any]:
    """The layers as they are; numpy's stay where they are.

    target: the light. guides: averaged over its pixels, if these are larger. guides_map: the guides
    that the models are evaluated on, if those are others. weight: which pixels count, or None.
    scene: of the frame that this one is a part of; the frame's own if None. filters: of a device.
    """
    return _images(frame, guide_layers.layers(frame, names, scene), filters)


def robust_images(
    frame: Frame,
    names: tuple[str, ...],
    scene: guide_layers.Scene | None = None,
    filters: Filters = FILTERS,
) -> dict[str, Any]:
    """`plain_images` with far depths drawn near and ambient occlusion without noise."""
    found = guide_layers.layers(frame, names, scene)
    layers = dict(zip(names, found, strict=False))
    if "depth" in layers:
        layers["depth"] = guide_layers.draw_near(layers["depth"])
    if "ao" in layers:
        layers["ao"] = filters.smooth(layers["ao"], frame.normal, frame.depth)
    # Without names there is one layer of no channels.
    return _images(frame, tuple(layers.values()) or found, filters)


def _images(frame: Frame, layers: tuple[Any, ...], filters: Filters) -> dict[str, Any]:
    target, mask, factor = frame.indirect, frame.mask, factor_of(frame)
    if factor == 1:
        weight = None if mask is None else mask[..., 0] > 0
        return {"target": target, "guides": layers, "guides_map": None, "weight": weight}
    return {
        "target": target,
        "guides": tuple(filters.shrink(layer, factor, mask) for layer in layers),
        "guides_map": layers,
        "weight": None if mask is None else filters.shrink(mask, factor)[..., 0],
    }
