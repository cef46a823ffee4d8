"""The arguments of a regression, checked at its boundary on static facts."""

import dataclasses
import math
from typing import Any

import numpy as np

from jflnr import checks


def check_options(method: Any) -> None:
    """Raise unless a method's numbers are positive and its block and support whole numbers.

    Numbers that JAX holds are not looked at: they may be traced.
    """
    for option in dataclasses.fields(method):
        value = getattr(method, option.name)
        if option.name in ("block", "levels", "support") and value is not None:
            checks.positive_integer(option.name, value)
        elif option.name == "solver":
            checks.choice("solver", value, ("cholesky", "block-inverse"))
        # A pytree of the same structure may hold derivatives, in arrays or numbers of numpy.
        elif not option.metadata.get("static") and type(value) in (bool, int, float):
            if isinstance(value, bool) or not (math.isfinite(value) and value > 0):
                raise ValueError(f"{option.name} is {value}; it must be a positive number")


def block_for(block: int, longest: int) -> int:
    """The side of blocks in a frame whose longer side has so many pixels: not far beyond it."""
    return min(block, 64 * max(-(-longest // 64), 1))


def check_regression(target: Any, guides: Any, guides_map: Any | None, weight: Any | None) -> int:
    """Raise on wrong arguments of `flr`; return how many times finer `guides_map` is."""
    checks.image("target", target)
    if target.shape[2] == 0:
        raise ValueError(f"target needs at least one channel; its shape is {target.shape}")
    if not layers_of(guides):
        raise ValueError("guides must be an array (H, W, Q) or several; Q may be 0 for none")
    for layer in layers_of(guides):
        checks.image("guides", layer)
        checks.same_size(target=target, guides=layer)
    if weight is not None and getattr(weight, "shape", None) != target.shape[:2]:
        raise ValueError(
            f"weight must be of shape {target.shape[:2]}, as target's pixels; "
            f"got {getattr(weight, 'shape', type(weight).__name__)}"
        )
    named = {"target": target, "guides": guides, "guides_map": guides_map}
    for name, images in named.items():
        for image in layers_of(images):
            if not (np.issubdtype(image.dtype, np.floating) or "float" in str(image.dtype)):
                raise TypeError(f"{name} must hold floating-point numbers; it holds {image.dtype}")
    return 1 if guides_map is None else _finer_by(target, guides, guides_map)


def _finer_by(target: Any, guides: Any, guides_map: Any) -> int:
    coarse = target.shape[:2]
    fine = {layer.shape[:2] for layer in layers_of(guides_map)} or {coarse}
    if channel_count(guides_map) != channel_count(guides) or len(fine) > 1:
        raise ValueError(
            f"guides_map must have the {channel_count(guides)} channels of guides and one size; "
            f"got {[layer.shape for layer in layers_of(guides_map)]}"
        )
    height, width = fine.pop()
    factor = checks.times_finer((height, width), coarse)
    if factor is None:
        raise ValueError(
            f"guides_map must be a whole number of times larger than guides; got {width} x "
            f"{height} against {coarse[1]} x {coarse[0]} pixels"
        )
    return factor


def layers_of(images: Any) -> list[Any]:
    """One image `(H, W, Q)`, or several in tuples, as a list."""
    if isinstance(images, tuple | list):
        return [layer for some in images for layer in layers_of(some)]
    return [] if images is None else [images]


def channel_count(images: Any) -> int:
    """The number of channels of an image `(H, W, Q)`, or of several together."""
    return sum(layer.shape[-1] for layer in layers_of(images))
