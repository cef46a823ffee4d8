"""Large frames made of real ones, side by side and mirrored."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

import jflnr
from experiments import data
from jflnr import exr
from jflnr.layouts.channels import LAYERS

PARTS = ("indirect", "albedo", "normal", "depth", "ao", "mask")


def names() -> dict[str, list[str]]:
    """Layer to channel names, as in our own files."""
    stems = {part: "indirect_1" if part == "indirect" else part for part in PARTS}
    return {part: [f"{stem}.{c}" for c in LAYERS[part]] for part, stem in stems.items()}


def write(path: Path, height: int, width: int, first: int = 0) -> None:
    """A frame of any size with the layers `PARTS`, as half; another one for each `first`."""
    frames = data.frames("train", "val", "test")
    rows, columns, _ = layers(frames[0]).shape
    channels = [channel for group in names().values() for channel in group]
    with exr.writing_rows(path, (height, width), dict.fromkeys(channels, np.float16)) as append:
        for band, top in enumerate(range(0, height, rows)):
            strip = strip_of(frames, band, -(-width // columns), first)[: height - top, :width]
            append({name: strip[..., i] for i, name in enumerate(channels)})


def strip_of(frames: list[Path], band: int, count: int, first: int) -> np.ndarray:
    """`count` frames in a row, every other one mirrored; each band begins with another frame."""
    numbers = [(first + 5 * band + i) % len(frames) for i in range(count)]
    chosen = [layers(frames[k])[:, :: -1 if i % 2 else 1] for i, k in enumerate(numbers)]
    return np.concatenate(chosen, axis=1)[:: -1 if band % 2 else 1]


@functools.cache
def layers(path: Path) -> np.ndarray:
    """The layers `PARTS` of a frame side by side, `(H, W, 12)` float16."""
    frame = jflnr.read_frame(path)
    images = [getattr(frame, part) for part in PARTS]
    return np.concatenate(images, axis=-1).astype(np.float16)
