"""What Mitsuba 3's `aov` integrator writes: plain `R G B`, and layers under the user's own names.

Depth is known by its component `T`, a distance along the ray, 0 where nothing is hit. The other
layers are known by the names that Mitsuba's manual uses and those of the types themselves.
"""

from collections.abc import Mapping

import numpy as np

from jflnr.exr import layers_of
from jflnr.layouts import common
from jflnr.layouts.channels import Layout

NOTES = (
    "R, G, B, without a nested integrator called emission, is divided by albedo and denoised",
    "depth is Mitsuba's distance along the ray, which serves as a guide as well as depth does",
)
ADVICE = {
    "albedo": "give the aov integrator albedo:albedo",
    "normal": "give the aov integrator sh_normal:sh_normal",
    "depth": "give the aov integrator depth:depth",
}
OWN = {"sh_normal", "geo_normal", "nn", "dd.y", "prim_index", "shape_index"}


def layout(channels: Mapping[str, np.ndarray]) -> Layout | None:
    """None unless there is a picture with a layer that only Mitsuba names so."""
    layers = layers_of(channels)
    distances = [layer for layer, parts in layers.items() if parts == ["T"]]
    if not {"R", "G", "B"} <= set(channels) or not (distances or OWN & set(layers)):
        return None
    names = common.find(channels)
    if distances:
        names["depth"] = (f"{distances[0]}.T",)
    return Layout("Mitsuba", names, common.picture(channels, names), NOTES, ADVICE)
