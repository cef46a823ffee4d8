"""The user's own word on which channels a layer is made of (`--map`, `read_frame(layers=...)`)."""

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from jflnr import checks, exr
from jflnr.layouts.channels import LAYERS, PICTURE, Layout, in_layer, present

FILE = re.compile(r"(?P<file>.+\.(exr|pfm))(:(?P<name>.+))?", re.IGNORECASE | re.DOTALL)

BORROWED = "file://"  # how the names of another file's channels start


def find(
    channels: dict[str, np.ndarray], layers: Mapping[str, str], path: Path
) -> dict[str, tuple[str, ...]]:
    """The channels of the `layers` that the user maps; those of other files are added.

    A value is a layer of the file, channels with commas between them, or `FILE.exr` or `FILE.pfm`,
    seen from the folder of `path`, with `:` and one of those after it; `{stem}` in it is the stem
    of `path`.
    Raises ValueError if there is no such thing, and OSError as `read_channels` does.
    """
    found = {}
    for name, value in layers.items():
        checks.choice("layers", name, (*LAYERS, *filter(PICTURE.get, PICTURE), "radiance"))
        if there := elsewhere(value, path):
            other, inside = there
            exr.check_aligned(path, other)
            read = exr.read_channels(other)
            chosen = _choose(read, name, inside, str(other))
            borrowed = {f"{BORROWED}{other}:{channel}": read[channel] for channel in chosen}
            channels |= borrowed
            found[name] = tuple(borrowed)
        else:
            found[name] = _choose(channels, name, value, str(path))
    exr.check_sizes(path, channels)
    return found


def override(
    layout: Layout, mapped: dict[str, tuple[str, ...]], channels: Collection[str]
) -> Layout:
    """`layout` with what the user maps of a file that holds `channels`."""
    names = dict(layout.channels)
    if "radiance" in mapped or (
        "beauty" in mapped and not set(names.get("indirect", ())) & set(channels)
    ):
        names = {n: c for n, c in names.items() if n not in ("indirect", "direct")}
    picture = layout.picture or mapped.get("beauty", ())
    return replace(layout, channels=names | mapped, picture=picture)


def elsewhere(value: str, path: Path) -> tuple[Path, str] | None:
    """The other file that a value of `find` names, if it does, and what in it."""
    if (match := FILE.fullmatch(value)) is None:
        return None
    return path.parent / match["file"].replace("{stem}", path.stem), match["name"] or ""


def _choose(
    channels: Mapping[str, np.ndarray], name: str, value: str, source: str
) -> tuple[str, ...]:
    listed = tuple(channel.strip() for channel in value.split(","))
    found = listed if set(listed) <= set(channels) else in_layer(channels, value)
    count = len((LAYERS | PICTURE).get(name, "RGB"))
    if not found:
        what = value or "a plain channel"
        raise ValueError(f"{source}: there is no {what} for {name}; {present(channels)}")
    if len(found) not in (1, count) and count != 1:
        raise ValueError(
            f"{source}: {name} is made of 1 or {count} channels, and {value} has {len(found)}"
        )
    return found
