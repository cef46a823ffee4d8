"""A file, and what its channels mean."""

import functools
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jflnr import checks, exr
from jflnr.files import json_object
from jflnr.layouts import blender, common, mitsuba, native, pbrt
from jflnr.layouts.channels import Layout, layer, present
from jflnr.layouts.override import find, override


@dataclass(frozen=True)
class Source:
    """What `load` found: every channel (H, W) in its own type, the header, and the layout.

    part: only some of the file's rows and channels are here. opaque: whether the picture's alpha is
    1 in all of the file, where that is known. shares: likewise, what `samples.shares_of` finds.
    """

    path: Path
    channels: dict[str, np.ndarray]
    attributes: exr.Attributes
    layout: Layout
    part: bool = False
    opaque: bool | None = None
    shares: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def header(self) -> dict:
        """The JSON object in the header's `comments`; {} if there is none."""
        return json_object(self.attributes.comments)


def load(
    path: exr.PathLike, spp: int | None = None, layers: Mapping[str, str] | None = None
) -> Source:
    """Read the file at `path` and see which layout it is in.

    spp: which noisy layer of a native file; by default the one of fewest samples. layers: as for
    `read_frame`. Raises OSError and ValueError as `read_frame` does.
    """
    if spp is not None:
        checks.positive_integer("spp", spp)
    path, attributes, channels = Path(path), exr.read_attributes(path), exr.read_channels(path)
    return Source(path, channels, attributes, recognise(channels, spp, layers or {}, path))


def is_picture(names: Collection[str]) -> bool:
    """Whether channels of these names are another program's picture."""
    return "beauty" in recognise(dict.fromkeys(names, np.zeros((1, 1)))).channels


def recognise(
    channels: dict[str, np.ndarray],
    spp: int | None = None,
    layers: Mapping[str, str] | None = None,
    path: Path = Path(),
) -> Layout:
    """The layout that the names of `channels` are in; the native one if they are in no other.

    layers: as for `load`, of the file at `path`; channels of other files are added.
    """
    own, counts = dict(channels), native.spp_present(channels)
    mapped = find(channels, layers or {}, path)
    if not counts:
        usual = functools.partial(common.layout, mapped=mapped)
        for program in (blender.layout, pbrt.layout, mitsuba.layout, usual):
            if (found := program(own)) is not None:
                return override(found, mapped, own)
    return override(native.layout(spp or (counts or [1])[0], own), mapped, own)


def picture(channels: Mapping[str, np.ndarray], source: str) -> np.ndarray:
    """The whole picture, (H, W, 3) float32: plain R, G, B or what the program calls it.

    Raises ValueError, naming `source`, if there is none.
    """
    names = tuple("RGB") if "R" in channels else recognise(dict(channels)).picture[:3]
    advice = f"there is no picture in it; {present(channels)}"
    return layer(channels, "beauty", names or tuple("RGB"), source, advice)
