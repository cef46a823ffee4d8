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

    Raises ValueError, naming `source`, as `layer` does.
    """
    return {
        name: layer(channels, name, names, source)
        if name in REQUIRED or any(channel in channels for channel in names)
        else None
        for name, names in layout.items()
    }


def layer(
    channels: Mapping[str, np.ndarray], name: str, names: tuple[str, ...], source: str
) -> np.ndarray:
    """Layer `name` of a Frame, float32 (H, W, C), from the channels `names`.

    Raises ValueError, naming `source`, if channels are missing or no value is finite.
    """
    stem = layer_of(names[0])
    missing = [channel for channel in names if channel not in channels]
    if missing == list(names):
        raise ValueError(f"{source}: layer {stem} is missing; {_present(channels, name)}")
    if missing:
        raise ValueError(f"{source}: layer {stem} lacks its channel {', '.join(missing)}")
    image = np.stack([channels[channel].astype(np.float32) for channel in names], axis=-1)
    if not np.isfinite(image).any():
        raise ValueError(f"{source}: layer {stem} is NaN or infinite everywhere")
    return image


def _present(channels: Mapping[str, np.ndarray], wanted: str) -> str:
    counts = spp_present(channels)
    if wanted == "indirect" and counts:
        return f"there is indirect light for spp {', '.join(map(str, counts))}"
    present = ", ".join(
        name or "plain " + "".join(parts) for name, parts in layers_of(channels).items()
    )
    return f"the file holds {present}"
