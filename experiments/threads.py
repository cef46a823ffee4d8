"""Calls from several threads at a time, against the same calls from one."""

from __future__ import annotations

import itertools
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import jflnr
from experiments.results import Parts

NAME = "threads"
QUESTION = "Do calls from several threads give what the same calls give one after another?"
MINUTES = 10

METHODS = ("flr", "flr-adaptive", "bmfr")
THREADS, CALLS, FRAMES = 8, 10_000, 6
# How often threads take turns: as often as Python lets them.
INTERVAL = 1e-6


def run(quick: bool) -> Parts:
    """How many results differ, by method and back end, of `CALLS` in all."""
    cases = list(itertools.product(METHODS, jflnr.BACKENDS))
    calls = 10 if quick else -(-CALLS // len(cases))
    rows = []
    for method, backend in cases:
        wrong = differing(made_up(FRAMES), method, backend, calls)
        row = {"method": method, "backend": backend, "threads": THREADS, "calls": calls}
        rows.append(row | {"wrong": wrong})
        print(f"  {method}, {backend}: {wrong} of {calls} differ", flush=True)
    return {"calls": rows}


def made_up(count: int, brightness: float = 1) -> list[jflnr.Frame]:
    """Frames of noise over smooth guides, of random sizes."""
    rng, frames = np.random.default_rng(0), []
    for height, width in rng.integers(17, 97, (count, 2)):
        y, x = np.mgrid[:height, :width].astype(np.float32)[..., None] / 32
        noise = rng.exponential(brightness, (height, width, 3)).astype(np.float32)
        normal = np.concatenate([np.sin(x), np.sin(y), 1 + 0 * x], axis=-1)
        frames.append(
            jflnr.Frame(
                indirect=noise, albedo=0 * noise + 1, normal=normal, depth=2 + x + y, ao=0.5 + 0 * x
            )
        )
    return frames


def differing(frames: list[jflnr.Frame], method: str, backend: str, calls: int) -> int:
    """How many of `calls` results of `THREADS` threads are not, to the bit, those of one."""

    def call(number: int) -> bytes:
        frame = frames[number % len(frames)]
        return np.asarray(jflnr.denoise(frame, method, backend=backend)).tobytes()

    alone = [call(i) for i in range(len(frames))]
    wrong = lambda number: call(number) != alone[number % len(frames)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(INTERVAL)
    try:
        with warnings.catch_warnings(), ThreadPoolExecutor(THREADS) as pool:
            warnings.simplefilter("ignore")
            return sum(pool.map(wrong, range(calls)))
    finally:
        sys.setswitchinterval(before)
