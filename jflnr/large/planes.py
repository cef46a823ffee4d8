"""Planes of block data in a temporary file: as much of them in memory as is being used."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np


class Planes:
    """`(count, height, width)` float32 on disk; a context manager, after which the file is gone.

    In the file the planes of a row lie together, since rows are what is written and read.
    """

    def __init__(self, folder: Path | None, count: int, height: int, width: int) -> None:
        self.height, self.width = height, width
        self.shape = (height, count, width)
        self.file = tempfile.TemporaryFile(dir=folder, prefix=".jflnr-")
        self.file.truncate(4 * count * height * width)

    def __enter__(self) -> Planes:
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()

    def __setitem__(self, area: tuple[slice, slice], planes: np.ndarray) -> None:
        rows, columns = area
        self._mapped()[rows, :, columns] = np.moveaxis(planes, 0, 1)

    def __getitem__(self, area: tuple[slice, slice]) -> np.ndarray:
        rows, columns = area
        return np.ascontiguousarray(np.moveaxis(self._mapped()[rows, :, columns], 1, 0))

    def _mapped(self) -> np.memmap:
        # Mapped anew each time: what was touched counts as this process's memory until unmapped.
        return np.memmap(self.file, np.float32, "r+", shape=self.shape)
