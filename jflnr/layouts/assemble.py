"""From a file's channels and its layout to the layers of a Frame."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jflnr.camera import Camera, centres
from jflnr.exr import Window
from jflnr.layouts.channels import LAYERS, NATIVE, PICTURE, layer
from jflnr.layouts.light import DARK, demodulate, rest
from jflnr.layouts.samples import samples_of
from jflnr.layouts.source import Source
from jflnr.layouts.surface import SKY

# Arrays, or None for a layer that is absent.
Layers = dict[str, Any]

# What no frame can do without; where a picture has no depth, it is 1 wherever there is a normal.
GUIDES = ("albedo", "normal", "depth")


def assemble(source: Source) -> Layers:
    """The Frame's layers as float32 (H, W, C), None for an optional one that is absent.

    Depth and position come from each other where one is absent and the camera known.
    Raises ValueError, naming the file, as `layer` does.
    """
    layout, channels = source.layout, source.channels
    whole = "beauty" in layout.channels
    absent = [layer for layer in GUIDES if layer not in layout.channels]
    names = dict(layout.channels) | {layer: NATIVE[layer] for layer in absent}
    if whole and layout.picture[3:]:
        names.setdefault("alpha", layout.picture[3:])
    there = {name for name in names if any(channel in channels for channel in names[name])}

    def read(name: str) -> np.ndarray:
        advice = layout.advice.get(name, "")
        return layer(channels, name, names[name], str(source.path), advice, source.part)

    # Others write worldToCamera too, transposed or looking another way.
    camera = camera_of(source.attributes.others if layout.program == "pbrt" else source.header)
    needed = {layout.light, *GUIDES}
    if "depth" not in there and (whole or (camera is not None and "position" in there)):
        needed.remove("depth")
    images: Layers = {name: read(name) for name in names if name in needed | there}
    images = dict.fromkeys((*LAYERS, *PICTURE)) | images
    if source.part and layout.program == "pbrt" and (read("depth") < 0).any():
        raise ValueError(
            "depth is negative in places, which only the whole file can explain: raise --memory"
        )
    if images["depth"] is not None:  # a camera that looks along -z
        images["depth"] = np.abs(images["depth"])
    if camera is not None:
        images |= _derived(images, camera, source.attributes.window)
    if whole and images["depth"] is None:
        hit = np.any(images["normal"], axis=-1, keepdims=True)
        images["depth"] = hit.astype(np.float32)
    if layout.motion_up and images["motion"] is not None:
        images["motion"] = images["motion"] * np.array([1, -1], np.float32)
    if layout.light != "indirect" or whole:
        separated = _separated(images)
        images |= (_picture(images | separated, images, source) if whole else {}) | separated
    if layout.lobes and not source.part:
        images |= _lobes(source)
    return {name: images[name] for name in (*LAYERS, *PICTURE)}


def camera_of(header: Mapping[str, Any]) -> Camera | None:
    """From our own header's entries or the attribute `worldToCamera`, as pbrt writes it.

    The latter does not say the field of view, which then is None.
    """
    try:
        if "worldToCamera" not in header:
            return Camera.of(header)
        to_camera = np.array(header["worldToCamera"], np.float64).reshape(4, 4)
        return Camera(np.linalg.inv(to_camera), None)
    except (TypeError, ValueError, OverflowError, np.linalg.LinAlgError):
        return None


def _derived(images: Layers, camera: Camera, window: Window) -> Layers:
    """Depth along the view axis or position in the world, if it is absent; 0 where nothing is."""
    position, depth, normal = images["position"], images["depth"], images["normal"]
    if depth is None and position is not None and normal is not None:
        along = (position - camera.to_world[:3, 3]) @ camera.to_world[:3, 2]
        hit = (normal != 0).any(axis=-1, keepdims=True)
        return {"depth": np.where(hit, along[..., None], 0).astype(np.float32)}
    if position is None and depth is not None and camera.fov_x is not None:
        height, width = depth.shape[:2]
        (x0, y0), display = window
        left, top, right, bottom = display or (x0, y0, x0 + width - 1, y0 + height - 1)
        pixels = centres(width, height) + np.array([x0 - left, y0 - top])
        points = camera.points(pixels, depth[..., 0], right - left + 1, bottom - top + 1)
        return {"position": np.where(depth > 0, points, 0).astype(np.float32)}
    return {}


@np.errstate(invalid="ignore", over="ignore")
def _separated(images: Layers) -> Layers:
    """The layers of another program's picture: what is denoised, and the rest of the picture.

    `albedo * (direct + indirect) + emission` is the beauty again. Where there is no surface or all
    of its albedo is at most `DARK`, the picture passes through as it is: albedo and mask are 0. So
    it does where one of its layers is NaN or infinite; such an albedo stays, to be counted.
    """
    depth, albedo, beauty = images["depth"], images["albedo"], images.get("beauty")
    others = (images[name] for name in ("albedo", "normal", "direct", "emission"))
    known = [_finite(image) for image in others if image is not None]
    known = np.logical_and.reduce([*known, ~np.isnan(depth)])
    depth = np.where((depth < SKY) | np.isnan(depth), depth, 0)
    mask, indirect, emission = images["mask"], images["indirect"], images["emission"]
    if mask is None:
        surface = (depth > 0) & (albedo > DARK).any(axis=-1, keepdims=True)
        mask = surface.astype(np.float32)
    mask = np.where(known, mask, 0)
    given, albedo = albedo, np.where(mask > 0, albedo, 0)
    if indirect is None:
        radiance: Any = images.get("radiance", beauty)
        indirect = demodulate(radiance - (0 if emission is None else emission), albedo)
    if beauty is not None:
        direct = images["direct"]
        emission = rest(beauty, albedo, indirect if direct is None else direct + indirect)
    return {
        "depth": depth,
        "albedo": np.where(_finite(given), albedo, given),
        "mask": mask,
        "indirect": indirect,
        "emission": emission,
    }


def _picture(images: Layers, given: Layers, source: Source) -> Layers:
    """The layers of the whole picture.

    Where nothing is hit, all of it is environment, unless the program tells or the film is
    transparent. given: the layers before the picture was separated.
    """
    beauty, environment, alpha = (images[name] for name in ("beauty", "environment", "alpha"))
    if alpha is not None and (np.all(alpha == 1) if source.opaque is None else source.opaque):
        alpha = None
    if environment is None and alpha is None:
        environment = np.where(images["depth"] == 0, beauty, np.zeros_like(beauty))
    seen, albedo, normal = images["seen_albedo"], given["albedo"], images["normal"]
    depth, number = images["depth"], images["samples"]
    if seen is None:
        # What mirrors and glass reflect, which have no diffuse albedo, is divided by 1.
        bare = (albedo <= DARK).all(axis=-1, keepdims=True) & (depth > 0)
        seen = np.where(bare, np.float32(1), albedo)
    if number is None and (count := samples_of(source, normal, seen, alpha)) is not None:
        number = np.broadcast_to(np.float32(count), depth.shape)
    return {
        "samples": number,
        "emitted": given["emission"],
        "environment": environment,
        "alpha": alpha,
        "seen_albedo": seen,
    }


def _lobes(source: Source) -> Layers:
    """The light passes and their colours."""
    lobes, channels = source.layout.lobes, source.channels
    height, width = next(iter(channels.values())).shape
    plane = lambda name, absent: channels.get(name, np.full((height, width), absent, np.float32))
    passes = [plane(name, 0) for lobe in lobes for name in lobe.direct + lobe.indirect]
    colours = [plane(name, 1) for lobe in lobes for name in lobe.colour]
    return {
        "lobes": np.stack(passes, axis=-1).astype(np.float32, copy=False),
        "lobe_colours": np.stack(colours, axis=-1).astype(np.float32, copy=False),
    }


def _finite(image: np.ndarray) -> np.ndarray:
    """Where all of a layer (H, W, C) are numbers, (H, W, 1)."""
    return np.isfinite(image).all(axis=-1, keepdims=True)
