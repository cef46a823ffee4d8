"""What every method gives and how long it takes, whole, in tiles and over time, on both back ends.

`python -m experiments.outputs record FILE` keeps that of this checkout; after a change that should
alter nothing, `python -m experiments.outputs compare BEFORE AFTER` says by how much it did.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

import jflnr
from experiments import data
from experiments.shots import SPATIAL

REPEATS = 5


def cases(frame: jflnr.Frame, later: jflnr.Frame) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Name and call of everything that a user can ask for."""
    for method in jflnr.METHODS:
        for backend in jflnr.BACKENDS:
            yield (
                f"{method} {backend} whole",
                partial(jflnr.denoise, frame, method, backend=backend),
            )
    for method, backend in [("flr", "opencl"), *((m, "jax") for m in SPATIAL)]:
        denoiser = jflnr.Denoiser(method, backend=backend, tile=160)
        yield f"{method} {backend} tiles", partial(denoiser, frame)
    for method in (*SPATIAL, "bmfr"):
        for backend in jflnr.BACKENDS:
            shot = frame, later, frame
            yield f"{method} {backend} sequence", partial(_last, method, backend, shot)


def _last(method: str, backend: str, frames: Sequence[jflnr.Frame]) -> np.ndarray:
    denoiser = jflnr.Denoiser(method, backend=backend)
    return [denoiser.next(frame) for frame in frames][-1]


def record(path: str) -> None:
    """Outputs and seconds (first call, median of the others) of all cases on a test frame."""
    file = data.frames("test")[0]
    frame = data.read(file)
    frame = dataclasses.replace(frame, motion=np.zeros((*frame.depth.shape[:2], 2), np.float32))
    later = dataclasses.replace(frame, indirect=data.read(file, 4).indirect)
    found: dict[str, np.ndarray] = {}
    for name, call in cases(frame, later):
        times = []
        for _ in range(1 + REPEATS):
            start = time.perf_counter()
            found[name] = np.asarray(call())
            times.append(time.perf_counter() - start)
        found[f"{name} seconds"] = np.array([times[0], np.median(times[1:])])
        print(f"{name}: {times[0]:.2f} s, then {np.median(times[1:]):.3f} s", flush=True)
    np.savez(path, **found)  # type: ignore[arg-type]


def compare(before: str, after: str) -> None:
    """Largest difference in parts of the maximum, and both times as ratios."""
    with np.load(before) as old, np.load(after) as new:
        for name in [name for name in old.files if not name.endswith("seconds")]:
            a, b = old[name].astype(np.float64), new[name].astype(np.float64)
            worst = np.nanmax(np.abs(a - b)) / np.nanmax(np.abs(a))
            first, later = new[f"{name} seconds"] / old[f"{name} seconds"]
            print(f"{name:32} {worst:.1e}  first call x {first:.2f}, others x {later:.2f}")


if __name__ == "__main__":
    commands: dict[str, Callable[..., None]] = {"record": record, "compare": compare}
    commands[sys.argv[1]](*sys.argv[2:])
