"""From the layers of a frame to the guides X of the regression (DESIGN.md, "Guides")."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from jflnr.frame import Array, Frame
from jflnr.images.noisy_guides import antialiased, holds_light, smooth_guide
from jflnr.lazy import jnp

DEFAULT = ("normal", "depth", "ao")
NAMES = ("normal", "depth", "ao", "position", "albedo")
# Median depths. Of training's frames with depths beyond, the best of 3 and 4.
FAR = 3


def choose(frame: Frame, names: Sequence[str] | None) -> tuple[str, ...]:
    """The guides to use: those asked for, or by default those of normal, depth, ao that exist, in
    the order of `NAMES`.

    Raises `ValueError` for a name that is no guide, is named twice, or that the frame lacks.
    """
    if names is None:
        return tuple(name for name in DEFAULT if getattr(frame, name) is not None)
    there = [name for name in NAMES if getattr(frame, name) is not None]
    for name in names:
        if name not in NAMES:
            raise ValueError(f"guides: {name!r} is none of {', '.join(NAMES)}")
        if name not in there:
            raise ValueError(f"guides: the frame has no {name} layer; it has {', '.join(there)}")
    if len(set(names)) < len(names):
        raise ValueError(f"guides: {', '.join(names)} names one of them twice")
    return tuple(name for name in NAMES if name in names)


class Scene(NamedTuple):
    """What the whole frame says of its scene, `()` and `(3,)`, so that parts of it agree.

    depth: median depth of the surfaces. middle: a point among them; zeros without positions.
    Without a beauty None: light, its mean; averaged, whether its layers are means of several
    samples per pixel; lit, whether its albedo shows what shines (`holds_light`).
    """

    depth: Any
    middle: Any
    light: Any = None
    averaged: Any = None
    lit: Any = None


def scene_of(frame: Frame) -> Scene:
    """That of a whole frame."""
    height, width = frame.depth.shape[:2]
    step = thinning(height, width)
    middle = None if frame.position is None else frame.position[height // 2, width // 2]
    return scene_from(frame.map(lambda layer: layer[::step, ::step]), middle)


def scene_from(sample: Frame, middle: Array | None) -> Scene:
    """That of a frame of which every so many pixels are given, and the position in its middle."""
    xp: Any = sample.depth.__array_namespace__()
    middle = xp.zeros(3, xp.float32) if middle is None else xp.nan_to_num(middle)
    scene = Scene(typical_depth(sample.depth, sample.mask), middle)
    if sample.beauty is None:
        return scene
    light = mean_light(sample.beauty)
    own = [layer for layer in (sample.emitted, sample.environment) if layer is not None]
    lit = holds_light(sample.seen_albedo, sum(own, xp.zeros_like(light)))
    return Scene(*scene[:2], light, antialiased(sample.normal), lit)


def mean_light(beauty: Array) -> Any:
    """Mean of what is finite, `()`; 0 if nothing is."""
    xp: Any = beauty.__array_namespace__()
    finite = xp.isfinite(beauty)
    total = xp.sum(xp.where(finite, xp.asarray(beauty, dtype=xp.float32), 0))
    return total / xp.maximum(xp.sum(finite), 1).astype(total.dtype)


def thinning(height: int, width: int) -> int:
    """Pixels from one to the next of a regular grid of about 16 000 pixels."""
    return max(round((height * width / 16384) ** 0.5), 1)


def typical_depth(depth: Array, mask: Array | None) -> Array:
    """Median depth of the surfaces; 1 if there are none.

    depth: `(H, W, 1)` in scene units. mask: `(H, W, 1)` or None. Returns a scalar.
    """
    xp = depth.__array_namespace__()
    sample = xp.asarray(depth, dtype=xp.float32)
    surface = (sample if mask is None else mask) > 0
    # What does not count lies beyond all that does.
    ordered = xp.sort(xp.where(surface & xp.isfinite(sample), sample, xp.inf), axis=None)
    count = xp.sum(xp.isfinite(ordered))
    middle = (ordered[xp.maximum(count - 1, 0) // 2] + ordered[count // 2]) / 2
    return xp.where((count > 0) & (middle > 0), middle, xp.float32(1))


def layers(frame: Frame, names: Sequence[str], scene: Scene | None = None) -> tuple[Any, ...]:
    """The guides as separate layers `(H, W, C)`, free of the scene's unit of length.

    Without guides, one layer of no channels. Depth is divided by its median over the mask; so is
    the position, about a point of the scene.
    scene: of the frame that this one is a part of; the frame's own if None.
    """
    scene = scene_of(frame) if scene is None else scene
    scale = 1 / scene.depth
    chosen = {name: getattr(frame, name) for name in names}
    if "depth" in chosen:
        chosen["depth"] = chosen["depth"] * scale
    if "position" in chosen:
        # Regularisation grows with a guide's distance from zero, and the origin means nothing.
        chosen["position"] = (chosen["position"] - scene.middle) * scale
    none = frame.depth[..., :0]
    return tuple(chosen[name] for name in names) or (none,)


def draw_near(depth: Array) -> Array:
    """Depth over its median, bent beyond `FAR` so that none exceeds `FAR + 1`.

    Where a room is seen into the open through a slit, the models of the blocks around, which know
    nothing so far away, would be extrapolated and leave bright streaks.
    """
    bent = lambda beyond: FAR + beyond / (1 + beyond)
    if not isinstance(depth, np.ndarray):
        return jnp.where(depth > FAR, bent(jnp.maximum(depth - FAR, 0)), depth)
    if not (far := depth > FAR).any():  # few pixels are, if any
        return depth
    near = depth.copy()
    near[far] = bent(depth[far] - FAR)
    return near


def shrink(image: Array, factor: int, mask: Array | None = None) -> Any:
    """Mean over `factor` x `factor` pixels, of those in the mask only.

    image: `(H, W, C)`. mask: `(H, W, 1)` or None. Returns `(ceil(H/f), ceil(W/f), C)`.
    """
    xp = image.__array_namespace__()
    weight = xp.ones((*image.shape[:2], 1), image.dtype) if mask is None else mask
    margins = [(0, -size % factor) for size in image.shape[:2]] + [(0, 0)]

    def totals(x: Array) -> Array:
        x = xp.pad(x, margins)
        h, w, c = x.shape[0] // factor, x.shape[1] // factor, x.shape[2]
        return x.reshape(h, factor, w, factor, c).sum((1, 3))

    return totals(image * weight) / xp.maximum(totals(weight), 1e-6)


class Filters(NamedTuple):
    """What is done to guides: `smooth_guide`, `regression.picture.filter_layers`, `shrink`.

    Each of a device, or of JAX, where the second is None.
    """

    smooth: Callable[..., Any] = smooth_guide
    layers: Callable[..., Any] | None = None
    shrink: Callable[..., Any] = shrink


FILTERS = Filters()
