"""What every method gives and how long it takes, whole, in tiles and over time, on both back ends.

`python -m experiments.outputs record FILE` keeps that of this checkout; after a change that should
alter nothing, `python -m experiments.outputs compare BEFORE AFTER` says by how much it did.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import jflnr
from experiments import data

SPATIAL = ("flr", "flr-adaptive", "flnr", "flnr-small", "flnr-tiny")
REPEATS = 5


def cases(frame: jflnr.Frame, later: jflnr.Frame) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Name and call of everything that a user can ask for."""
    for method in (*SPATIAL, "bmfr", "auto"):
        for backend in ("jax", "opencl") if method != "auto" else ("jax",):
            yield (
                f"{method} {backend} whole",
                lambda m=method, b=backend: jflnr.denoise(frame, m, backend=b),
            )
    for method, backend in [("flr", "opencl"), *((m, "jax") for m in SPATIAL)]:
        yield (
            f"{method} {backend} tiles",
            lambda m=method, b=backend: jflnr.denoise(frame, m, backend=b, tile=160),
        )
    for method in (*SPATIAL, "bmfr"):
        for backend in ("jax", "opencl"):
            yield (
                f"{method} {backend} sequence",
                lambda m=method, b=backend: _sequence(m, b, [frame, later, frame]),
            )


def _sequence(method: str, backend: str, frames: list[jflnr.Frame]) -> Any:
    from jflnr import opencl, temporal
    from jflnr.opencl import bmfr as opencl_bmfr
    from jflnr.opencl import temporal as opencl_temporal
    from jflnr.temporal import bmfr

    home = {
        ("bmfr", "jax"): bmfr,
        ("bmfr", "opencl"): opencl_bmfr,
        ("jax",): temporal,
        ("opencl",): opencl_temporal,
    }[(method, backend) if method == "bmfr" else (backend,)]
    assert opencl
    options = {} if method == "bmfr" else {"method": method}
    state = home.start(frames[0])
    for frame in frames:
        state, image = home.step(state, frame, **options)
    return image


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
    np.savez(path, **found)


def compare(before: str, after: str) -> None:
    """Largest difference in parts of the maximum, and both times as ratios."""
    with np.load(before) as old, np.load(after) as new:
        for name in [name for name in old.files if not name.endswith("seconds")]:
            a, b = old[name].astype(np.float64), new[name].astype(np.float64)
            worst = np.nanmax(np.abs(a - b)) / np.nanmax(np.abs(a))
            first, later = new[f"{name} seconds"] / old[f"{name} seconds"]
            print(f"{name:32} {worst:.1e}  first call x {first:.2f}, others x {later:.2f}")


if __name__ == "__main__":
    command = {"record": record, "compare": compare}[sys.argv[1]]
    command(*sys.argv[2:])
