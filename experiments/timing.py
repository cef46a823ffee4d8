"""Times of methods taken in turns, against the memory floor of the same run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import jflnr
from experiments.methods import Method
from experiments.speed import enlarge, interleaved

FULL = (1080, 1920)


def times(
    methods: Sequence[Method], frame: jflnr.Frame, quick: bool, repeats: int = 5
) -> dict[str, dict[str, float]]:
    """Method name to `ms` and `floors`: milliseconds at 1920 x 1080, and times the memory floor.

    If quick, once and at the frame's own size, for which programs have been compiled already.

    The floor is `np.copyto` between two float32 arrays of H x W x 8, what FLR reads and writes.
    """
    large = frame if quick else enlarge(frame, *FULL)
    height, width = large.depth.shape[:2]
    source = np.ones((height, width, 8), np.float32)
    target = np.zeros_like(source)
    calls: dict[str, Any] = {"memory floor": lambda: np.copyto(target, source)}
    calls |= {method.name: method.prepare(large) for method in methods}
    seconds = interleaved(calls, 1 if quick else repeats)
    floor = seconds["memory floor"]
    return {name: {"ms": 1e3 * t, "floors": t / floor} for name, t in seconds.items()}
