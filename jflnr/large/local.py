"""Fast Local Regression piece by piece: strips that overlap by the reach of the window."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from jflnr.frame import Array, Frame
from jflnr.large.pieces import pieces
from jflnr.large.source import Rows

# The first row of a strip, and its denoised light `(h, W, C)`.
Strip = tuple[int, np.ndarray]


def strips(
    rows: Rows, denoise: Callable[[Frame], Array], *, height: int, block: int, support: int
) -> Iterator[Strip]:
    """The frame in strips from top to bottom.

    denoise: of some rows. height: of a strip. block: pixels that share one model. support: how far
    the window reaches, in pixels. A row takes its models from the blocks beside its own too, and
    each of those looks `support` pixels farther.
    """
    align = math.lcm(block, rows.factor)
    reach = (-(-support // block) + 2) * block
    for piece in pieces(rows.height, height, reach, align):
        frame = rows.read(piece.low, piece.high)
        yield piece.start, np.asarray(denoise(frame))[piece.kept]
