"""The layout of our own files (DESIGN.md, "The frame")."""

from collections.abc import Mapping, Sequence

import numpy as np

from jflnr.exr import layers_of
from jflnr.layouts.channels import NATIVE, Layout


def layout(spp: int, counts: Sequence[int] = ()) -> Layout:
    """The layout whose noisy light at `spp` samples per pixel is `indirect_{spp}`.

    `counts` are the samples per pixel that a file has such layers for.
    """
    names = NATIVE | {"indirect": tuple(f"indirect_{spp}.{c}" for c in "RGB")}
    listed = ", ".join(map(str, counts))
    advice = {"indirect": f"there is indirect light for spp {listed}"} if counts else {}
    return Layout("jflnr" if counts else "unknown", names, advice=advice)


def spp_present(channels: Mapping[str, np.ndarray]) -> list[int]:
    """The samples per pixel N for which the file holds a layer `indirect_N`."""
    counts = (layer.removeprefix("indirect_") for layer in layers_of(channels))
    return sorted(int(count) for count in counts if count.isascii() and count.isdigit())
