"""Times of methods taken in turns, on one frame in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import jflnr
from experiments.methods import Method

REPEATS = 15


def times(methods: Sequence[Method], frame: jflnr.Frame, quick: bool) -> dict[str, float]:
    """Method name to milliseconds, the best of `REPEATS` (1 if quick), at the frame's own size.

    That is 640 x 360 for the frames of the data folder; `speed` measures at 1920 x 1080.
    """
    calls = {method.name: method.prepare(frame) for method in methods}
    seconds = interleaved(calls, 1 if quick else REPEATS)
    return {name: 1e3 * t for name, t in seconds.items()}


def interleaved(
    calls: dict[str, Callable[[], Any]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """The best time of each call in seconds, taken in turns so that all meet the same machine.

    clock: `time.process_time` counts what all cores do, whatever else the machine does.
    """
    best = dict.fromkeys(calls, float("inf"))
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            start = clock()
            call()
            best[name] = min(best[name], clock() - start)
    return best
