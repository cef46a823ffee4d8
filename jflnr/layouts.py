"""Which channels of a file make up which layer of a Frame.

A layout maps a layer of the Frame to its channel names, in order. `native` is this project's own
(DESIGN.md, "The frame"); nothing behind this module knows where a frame came from.
"""

from collections.abc import Mapping

import numpy as np

from jflnr.exr import layer_of, layers_of

Layout = dict[str, tuple[str, ...]]

COMPONENTS = {
    "indirect": "RGB",
    "albedo": "RGB",
    "normal": "XYZ",
    "depth": "Z",
    "position": "XYZ",
    "ao": "Y",
    "mask": "Y",
    "emission": "RGB",
    "direct": "RGB",
    "reference": "RGB",
    "reference_a": "RGB",
    "motion": "XY",
}
REQUIRED = ("indirect", "albedo", "normal", "depth")


def native(spp: int) -> Layout:
    """The layout of our own files, whose noisy light at `spp` samples is `indirect_{spp}`."""
    return {
        layer: tuple(f"{f'indirect_{spp}' if layer == 'indirect' else layer}.{c}" for c in parts)
        for layer, parts in COMPONENTS.items()
    }


def spp_present(channels: Mapping[str, np.ndarray]) -> list[int]:
    """The samples per pixel N for which the file holds a layer `indirect_N`."""
    counts = (layer.removeprefix("indirect_") for layer in layers_of(channels))
    return sorted(int(count) for count in counts if count.isascii() and count.isdigit())


def assemble(
    channels: Mapping[str, np.ndarray], layout: Layout, source: str
) -> dict[str, np.ndarray | None]:
    """The Frame's layers as float32 (H, W, C), None for an optional one that is absent.

    Raises ValueError, naming `source`, for a required layer that is missing, a layer that lacks a
    channel, and a layer without one finite value.
    """
    layers: dict[str, np.ndarray | None] = {}
    for layer, names in layout.items():
        missing = [name for name in names if name not in channels]
        if missing == list(names) and layer not in REQUIRED:
            layers[layer] = None
            continue
        if missing:
            raise ValueError(_missing(channels, layer, names, missing, source))
        image = np.stack([channels[name].astype(np.float32) for name in names], axis=-1)
        if not np.isfinite(image).any():
            raise ValueError(f"{source}: layer {layer_of(names[0])} is NaN or infinite everywhere")
        layers[layer] = image
    return layers


def _missing(
    channels: Mapping[str, np.ndarray],
    layer: str,
    names: tuple[str, ...],
    missing: list[str],
    source: str,
) -> str:
    stem = layer_of(names[0])
    if len(missing) < len(names):
        return f"{source}: layer {stem} lacks its channel {', '.join(missing)}"
    if layer == "indirect" and (counts := spp_present(channels)):
        present = ", ".join(map(str, counts))
        return f"{source}: layer {stem} is missing; there is indirect light for spp {present}"
    present = ", ".join(name or "plain R, G, B" for name in layers_of(channels))
    return f"{source}: layer {stem} is missing; the file holds {present}"
