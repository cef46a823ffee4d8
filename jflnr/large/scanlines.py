"""EXR files read a few rows at a time, through OpenImageIO.

OpenEXR's own Python module only knows whole files. Files of one part in scan lines can be read so.
"""

import dataclasses
import functools
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jflnr import exr, layouts
from jflnr.frame import Frame, frame_of
from jflnr.large.source import Rows
from jflnr.layouts.samples import AROUND, Shares, shares_of, told_samples
from jflnr.layouts.source import recognise

# Rows that are decoded at a time; every compression packs a divisor of it together.
BATCH = 64
# What `layouts.assemble` makes a frame's layers of, whichever are asked for.
NEEDED = ("indirect", "radiance", "beauty", "emission", "albedo", "normal", "depth", "position")

# What `shares_of` reads.
SHOWING = "normal", "seen_albedo", "alpha"


def _openimageio() -> Any:
    try:
        import OpenImageIO
    except ImportError:
        raise ImportError(
            "the frame is larger than the memory it may take, and reading it in parts needs "
            "OpenImageIO: pip install 'jflnr[large]', or raise --memory"
        ) from None
    # What a file may announce is bounded where its header is read, for either reader.
    for limit in ("imagesize_MB", "resolution", "channels"):
        OpenImageIO.attribute(f"limits:{limit}", 0)
    return OpenImageIO


def _opened(path: Path) -> Any:
    """The open file; OpenImageIO takes no names that are not UTF-8."""
    open_file = _openimageio().ImageInput.open
    with tempfile.TemporaryDirectory() as folder:
        try:
            str(path).encode()
        except UnicodeEncodeError:
            link = Path(folder) / "link.exr"
            link.symlink_to(path.resolve())
            path = link
        return open_file(str(path))


class Scanlines:
    """An open file: its size, attributes and layout, and any rows of its channels.

    Raises ValueError for a file that can only be read whole, and OSError.
    """

    def __init__(self, path: Path, spp: int | None, names: Mapping[str, str]) -> None:
        self.path, self.attributes = path, exr.read_attributes(path)
        self.file = _opened(path)
        if self.file is None:
            # Taken, or it is printed at the end of the process.
            why = next(iter(_openimageio().geterror().splitlines()), "it is damaged")
            raise ValueError(f"{path} cannot be read in parts: {why}")
        spec = self.file.spec()
        if self.attributes.parts > 1 or spec.tile_width:
            raise ValueError(
                f"{path} has several parts or tiles, so it can only be read whole: raise --memory, "
                "or write it as one part in scan lines"
            )
        self.height, self.width = spec.height, spec.width
        self.channels = tuple(map(exr.latin_1, spec.channelnames))
        nothing = dict.fromkeys(self.channels, np.zeros((1, 1)))
        self.layout = recognise(nothing, spp, names, path)
        if len(nothing) > len(self.channels):
            raise ValueError(f"{path}: --map to another file needs both whole: raise --memory")

    def part(self, start: int, stop: int, layers: Collection[str]) -> layouts.Source:
        """Rows `start` to `stop` of the channels that make up these layers of a frame."""
        return self._part(start, stop, layers, self.shares)

    @functools.cached_property
    def opaque(self) -> bool:
        """Whether the picture's alpha, if it has one, is 1 everywhere."""
        names = [name for name in self.layout.picture[3:] if name in self.channels]
        starts = range(0, self.height, BATCH) if names else ()
        stops = (min(start + BATCH, self.height) for start in starts)
        parts = (self._read(*rows, names) for rows in zip(starts, stops, strict=True))
        return all(np.all(part[name] == 1) for part in parts for name in names)

    @functools.cached_property
    def shares(self) -> Shares:
        """What tells the samples of a picture of Blender, where its header does not."""
        nothing = np.zeros(0), np.zeros(0)
        if self.layout.program != "Blender" or told_samples(self.layout, self.attributes):
            return nothing
        found = []
        for start in range(0, self.height, BATCH):
            stop = min(start + BATCH + AROUND, self.height)
            images = layouts.assemble(self._part(start, stop, SHOWING, nothing))
            normal, albedo, alpha = (images[name] for name in SHOWING)
            found.append(shares_of(normal, albedo, alpha, BATCH))
        turned, others = zip(*found, strict=True)
        return np.concatenate(turned), np.concatenate(others)

    def rows(self, layers: Collection[str]) -> Rows:
        """The rows of these layers on demand."""

        def read(start: int, stop: int) -> Frame:
            found = frame_of(self.part(start, stop, layers))
            other = found.layers().keys() - set(layers)
            return dataclasses.replace(found, **dict.fromkeys(other))  # type: ignore[arg-type]

        return Rows(self.height, self.width, read)

    def _part(
        self, start: int, stop: int, layers: Collection[str], shares: Shares
    ) -> layouts.Source:
        wanted = {*NEEDED, *layers}
        names = {c for n, chosen in self.layout.channels.items() if n in wanted for c in chosen}
        names |= set(self.layout.picture[3:])  # alpha, which goes on to the output
        channels = self._read(start, stop, sorted(names & set(self.channels)))
        (x, y), display = self.attributes.window
        attributes = self.attributes._replace(window=exr.Window((x, y + start), display))
        whole = self.opaque, shares
        return layouts.Source(self.path, channels, attributes, self.layout, True, *whole)

    def _read(self, start: int, stop: int, names: list[str]) -> dict[str, np.ndarray]:
        places = [self.channels.index(name) for name in names]
        first, last = min(places), max(places) + 1
        found = np.empty((len(names), stop - start, self.width), np.float32)
        top = self.file.spec().y
        for row in range(start, stop, BATCH):
            end = min(row + BATCH, stop)
            pixels = self.file.read_scanlines(0, 0, top + row, top + end, 0, first, last, "float")
            if pixels is None:
                raise ValueError(f"{self.path} is truncated or damaged: {self.file.geterror()}")
            for plane, place in zip(found, places, strict=True):
                plane[row - start : end - start] = pixels[..., place - first]
        return dict(zip(names, found, strict=True))
