"""Planes of block data in a temporary file: as much of them in memory as is being used."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np


class Planes:
    """`(*lead, *size)` float32 in `file`, which is gone once that is closed.

    There the planes of a row lie together, since rows are what is written and read. side: of the
    blocks that they are on, in pixels; 0 for pixels.
    """

    def __init__(
        self, folder: Path | None, lead: tuple[int, ...], size: tuple[int, int], side: int = 0
    ) -> None:
        self.lead, self.side = lead, side
        self.shape = size[0], math.prod(lead), size[1]
        self.file = tempfile.TemporaryFile(dir=folder, prefix=".jflnr-")
        self.file.truncate(4 * math.prod(self.shape))

    def __setitem__(self, area: tuple[slice, slice], planes: np.ndarray) -> None:
        rows, columns = area
        flat = planes.reshape(-1, *planes.shape[-2:])
        self._mapped()[rows, :, columns] = np.moveaxis(flat, 0, 1)

    def __getitem__(self, area: tuple[slice, slice]) -> np.ndarray:
        rows, columns = area
        found = np.ascontiguousarray(np.moveaxis(self._mapped()[rows, :, columns], 1, 0))
        return found.reshape(*self.lead, *found.shape[1:])

    def _mapped(self) -> np.memmap:
        # Mapped anew each time: what was touched counts as this process's memory until unmapped.
        return np.memmap(self.file, np.float32, "r+", shape=self.shape)
