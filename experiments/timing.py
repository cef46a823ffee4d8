"""Times of methods taken in turns, on one frame in one process."""

from __future__ import annotations

from collections.abc import Sequence

import jflnr
from experiments.methods import Method
from experiments.speed import interleaved

REPEATS = 15


def times(methods: Sequence[Method], frame: jflnr.Frame, quick: bool) -> dict[str, float]:
    """Method name to milliseconds, the best of `REPEATS` (1 if quick), at the frame's own size.

    That is 640 x 360 for the frames of the data folder; `speed` measures at 1920 x 1080.
    """
    calls = {method.name: method.prepare(frame) for method in methods}
    seconds = interleaved(calls, 1 if quick else REPEATS)
    return {name: 1e3 * t for name, t in seconds.items()}
