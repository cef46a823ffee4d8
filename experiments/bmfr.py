"""BMFR's own tables: time by kernel, and OpenCL against JAX."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments import shots
from experiments.methods import backends
from experiments.results import Parts
from experiments.speed import enlarge
from experiments.timing import interleaved
from jflnr.bmfr import pipeline as bmfr
from jflnr.bmfr.pipeline import BMFR

NAME = "bmfr"
QUESTION = "Where does BMFR's time go, and do both back ends agree?"
MINUTES = 1

WIDTH, HEIGHT = 1280, 720
BLOCKS = (16, 32, 64)
# The paper's Table 4: milliseconds on an AMD Radeon Vega Frontier Edition, with blocks of 32.
TABLE_4 = {
    "accumulate_light": 0.44,
    "fit": 1.55,
    "weighted_sum": 0.12,
    "accumulate_fitted": 0.23,
    "taa": 0.16,
    "all kernels": 2.54,
}
LAYERS = ("light", "fitted", "picture")
LENGTH = 16  # frames


def run(quick: bool) -> Parts:
    """Milliseconds by kernel and block at 1280 x 720, and the largest differences by sequence."""
    names = shots.names()[: 1 if quick else None]
    rows = [agreement(shots.load(name), block) for name in names for block in BLOCKS]
    size = (90, 160) if quick else (HEIGHT, WIDTH)
    times = kernels(size, 1 if quick else 15)
    return {"kernels, 1280 x 720": times, "OpenCL against JAX": rows}


def kernels(size: tuple[int, int], repeats: int) -> list[dict[str, Any]]:
    """Each kernel's best time, also as a multiple of the memory floor, by block size."""
    if "opencl" not in backends():
        return []
    from jflnr.opencl import bmfr as on_device
    from jflnr.opencl.context import default_context
    from jflnr.opencl.profile import profile

    before, now = (enlarge(frame, *size) for frame in shots.made_up(2).frames)
    source = np.ones((*size, 8), np.float32)
    target = np.zeros_like(source)
    rows: dict[str, dict[str, Any]] = {}
    for block in BLOCKS:
        parameters = BMFR(block=block)
        history, _ = on_device.step(on_device.start(before), before, parameters)
        work = lambda h=history, p=parameters: on_device.step(h, now, p)
        floor = interleaved({"floor": lambda: np.copyto(target, source)}, repeats)["floor"]
        for row in profile(default_context(), work, repeats):
            if row.kernel == "copy":
                continue
            found = rows.setdefault(row.kernel, {"kernel": row.kernel, "mb": row.bytes / 1e6})
            found |= {f"{block} ms": row.ms, f"{block} floors": row.ms / 1e3 / floor}
            found["paper"] = TABLE_4[row.kernel]
    return list(rows.values())


def agreement(shot: shots.Shot, block: int) -> dict[str, Any]:
    """Largest difference between JAX and OpenCL over a sequence, of each layer's largest value."""
    from jflnr.opencl import bmfr as on_device

    parameters = BMFR(block=block)
    frames = shot.frames[:LENGTH]
    ours, right = on_device.start(frames[0]), bmfr.start(frames[0])
    row: dict[str, Any] = dict.fromkeys(("image", *LAYERS), 0.0)
    for frame in frames:
        ours, found = on_device.step(ours, frame, parameters)
        right, image = bmfr.step(right, frame, parameters)
        pairs = {"image": (found, image)}
        pairs |= {name: (getattr(ours, name).get(), getattr(right, name)) for name in LAYERS}
        for name, (one, other) in pairs.items():
            row[name] = max(row[name], difference(one, np.asarray(other)))
    return {"sequence": shot.name, "block": block, "frames": len(frames), **row}


def difference(found: np.ndarray, right: np.ndarray) -> float:
    """The largest, relative to the largest value."""
    return float(np.abs(found - right).max() / np.abs(right).max())
