"""One rendered frame: noisy indirect light, noise-free guides, and what puts the picture together.

Layers and their meaning are DESIGN.md's ("The frame").
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from jflnr import checks, exr, layouts
from jflnr.files import json_object
from jflnr.lazy import jax, pytree

Array: TypeAlias = "np.ndarray | jax.Array"

HALF_MAX = float(np.finfo(np.float16).max)


@pytree
@dataclass(frozen=True, kw_only=True)
class Frame:
    """The layers of one frame, (H, W, C) float32 or None; those of one channel may be (H, W).

    Light is demodulated: multiplied by `albedo` it is reflected radiance. Of another program's
    picture, `albedo`, `indirect`, `direct` and `emission` are its diffuse light and the rest.
    """

    indirect: Array  # (H, W, 3) noisy indirect light
    normal: Array  # (H, W, 3) world space, unit, turned to the camera; 0 where nothing is hit
    depth: Array  # (H, W, 1) along the view axis, scene units; 0 where nothing is hit
    albedo: Array | None = None  # (H, W, 3) diffuse reflectance, linear
    position: Array | None = None  # (H, W, 3) world space
    ao: Array | None = None  # (H, W, 1) share of free rays
    mask: Array | None = None  # (H, W, 1) 1 where there is a surface to denoise
    emission: Array | None = None  # (H, W, 3) what else the picture holds: emitted light, sky, ...
    direct: Array | None = None  # (H, W, 3) converged direct light
    reference: Array | None = None  # (H, W, 3) converged indirect light
    reference_a: Array | None = None  # (H, W, 3) mean of the first half of its samples
    motion: Array | None = None  # (H, W, 2) pixels to where this point was one frame ago

    # Of another program's whole picture, each as noisy as the program wrote it.
    beauty: Array | None = None  # (H, W, 3) the picture
    alpha: Array | None = None  # (H, W, 1) share of the pixel that is covered; None for all of it
    emitted: Array | None = None  # (H, W, 3) of the beauty: what seen surfaces emit
    environment: Array | None = None  # (H, W, 3) of the beauty: what is seen behind all surfaces
    seen_albedo: Array | None = None  # (H, W, 3) of what is seen, also in mirrors and through glass
    seen_normal: Array | None = None  # (H, W, 3) likewise
    lobes: Array | None = None  # (H, W, 6 n) direct and indirect light of n kinds of surfaces
    lobe_colours: Array | None = None  # (H, W, 3 n) what that is to be multiplied by
    samples: Array | None = None  # (H, W, 1) that these are means of; 0 where nobody says how many

    def layers(self) -> dict[str, Array]:
        """Those that there are, by name."""
        return {name: layer for name, layer in vars(self).items() if layer is not None}

    def map(self, change: Callable[[Array], Array]) -> Frame:
        """The frame with every layer changed."""
        changed = {name: change(layer) for name, layer in self.layers().items()}
        return dataclasses.replace(self, **changed)


def read_frame(path: exr.PathLike, spp: int = 1, layers: Mapping[str, str] | None = None) -> Frame:
    """Read the frame at `path`, an EXR file of ours or of another renderer (docs/layouts.md).

    spp: of a file of ours, take the noisy layer `indirect_{spp}`. layers: for layers that are not
    found by themselves, the name of the file's layer, its channels with commas between them, or
    another file: `{"albedo": "diffuse.colour", "depth": "Z", "normal": "normals.exr"}`.

    Raises OSError for a file that cannot be opened, and ValueError, in one sentence, for one that
    is not a usable frame.
    """
    return frame_of(layouts.load(path, spp, layers))


def frame_of(source: layouts.Source) -> Frame:
    """The frame in a file that `layouts.load` read; raises as `read_frame` does."""
    return Frame(**layouts.assemble(source))


def read_header(path: exr.PathLike) -> dict:
    """The JSON object in the header's `comments` (scene, camera, ...); {} if there is none."""
    return json_object(exr.read_attributes(path).comments)


def write_frame(path: exr.PathLike, frame: Frame, spp: int = 1, header: dict | None = None) -> None:
    """Write `frame` in the native layout, its noisy layer as `indirect_{spp}`, atomically.

    Depth is stored as float, the rest as half, unless a layer has values that half cannot hold.
    """
    channels: dict[str, np.ndarray] = {}
    for layer, names in layouts.native.layout(spp).channels.items():
        if (image := getattr(frame, layer)) is not None:
            checks.image(layer, image, len(names))
            pixels = np.asarray(image, np.float32)
            large = np.abs(pixels[np.isfinite(pixels)]).max(initial=0) > HALF_MAX
            stored = pixels if layer == "depth" or large else pixels.astype(np.float16)
            channels.update({name: stored[..., i] for i, name in enumerate(names)})
    exr.write_channels(path, channels, None if header is None else json.dumps(header))


def composite(frame: Frame, indirect: Array) -> Array:
    """The picture `albedo * (direct + indirect) + emission`, (H, W, 3); an absent layer is 0.

    Where albedo is NaN or infinite it is `emission`, which for other programs is all of it.
    Raises ValueError without albedo.
    """
    if frame.albedo is None:
        raise ValueError("composite needs frame.albedo, by which the light is multiplied")
    checks.image("indirect", indirect, 3)
    checks.same_size(albedo=frame.albedo, indirect=indirect)
    light = indirect if frame.direct is None else frame.direct + indirect
    xp: Any = frame.albedo.__array_namespace__()
    known = xp.isfinite(frame.albedo).all(axis=-1, keepdims=True) & (frame.albedo != 0)
    picture = xp.where(known, frame.albedo * light, 0)
    return picture if frame.emission is None else picture + frame.emission


def not_finite(frame: Frame) -> dict[str, int]:
    """How many pixels of each layer hold a NaN or an infinity, for the layers that have any."""
    counts = {}
    for name, image in frame.layers().items():
        if not (finite := np.isfinite(image)).all():
            counts[name] = int((~finite.all(axis=-1)).sum())
    return counts
