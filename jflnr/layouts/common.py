"""Files of no program we know, read by the names that many give their layers."""

from collections.abc import Iterable, Mapping

import numpy as np

from jflnr.exr import layers_of
from jflnr.layouts.channels import Layout, in_layer

# The last part of a layer's name, in lower case; the earlier ones are preferred.
NAMES = {
    "albedo": ("albedo", "diffuse_albedo", "visiblediffuse", "diffuse_color", "basecolor"),
    "normal": (
        *("sh_normal", "shading_normal", "sn", "ns", "nn", "normal", "normals", "n"),
        *("visiblenormals", "optixnormals", "geo_normal", "geometric_normal", "gn", "ng"),
    ),
    "depth": ("depth", "z"),
    "position": ("position", "pos", "p", "world_position"),
    "emission": ("emission", "emitted", "emit"),
    "ao": ("ao", "ambient_occlusion"),
}
BEAUTY = ("", "beauty", "composite", "rgba", "rgb", "color")
NOTE = "the picture is divided by albedo and denoised; where the names mislead, use --map"


def layout(channels: Mapping[str, np.ndarray], mapped: dict[str, tuple[str, ...]]) -> Layout | None:
    """None unless there are a picture and an albedo, by such names or as the user says."""
    names = find(channels) | mapped
    if not {"beauty", "albedo"} <= set(names):
        return None
    return Layout("unknown, by common names", names, picture(channels, names), (NOTE,))


def find(channels: Mapping[str, np.ndarray]) -> dict[str, tuple[str, ...]]:
    """The channels of every layer whose name is a usual one."""
    layers = layers_of(channels)
    found = {}
    for layer, usual in (NAMES | {"beauty": BEAUTY}).items():
        by_name = {stem.rpartition(".")[2].lower(): stem for stem in reversed(layers)}
        candidates = [in_layer(channels, by_name[name]) for name in usual if name in by_name]
        candidates += [(name,) for name in channels if name.lower() in usual]
        count = 1 if layer in ("depth", "ao") else 3
        if fitting := [names for names in candidates if len(names) == count]:
            found[layer] = fitting[0]
    return found


def picture(channels: Iterable[str], names: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The channels of the beauty, and its alpha if it has one."""
    first = names["beauty"][0]
    alpha = first[:-1] + {"R": "A", "r": "a"}.get(first[-1], "")
    return names["beauty"] + ((alpha,) if alpha in channels else ())
