"""Blocks of pixels that share one model: what is lost and won, and what not to make smaller."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, plots, results, resume
from experiments.methods import Method
from experiments.timing import times
from experiments.tune import quick_psnr
from experiments.upsample import traced_at
from jflnr.frame import Array, Frame

NAME = "block"
QUESTION = "Is there 'no discernible loss' at blocks of 8 x 8, and may the inputs shrink instead?"
MINUTES = 2

WAYS = {
    "moments": "moments made smaller (FLR)",
    "mean": "inputs made smaller, by averaging",
    "nearest": "inputs made smaller, every n-th pixel",
}


def run(quick: bool) -> dict[str, Any]:
    """Mean PSNR over the test frames and milliseconds at 640 x 360, for blocks 1 to 32."""
    sizes = (1, 8) if quick else (1, 2, 4, 8, 16, 32)
    paths = [data.SHIPPED] if quick else data.frames("test")
    frames = [data.read(path) for path in paths]
    # At 32 the smaller inputs no longer tell their factor: 360 / 32 is not whole.
    keys = [f"moments {size}" for size in sizes]
    keys += [
        f"{way} {size}" for way in WAYS for size in sizes if 1 < size < 32 and way != "moments"
    ]

    def accuracy(key: str) -> list[float]:
        way, size = key.split()
        return [quick_psnr(frame, shrunk(frame, way=way, block=int(size))) for frame in frames]

    found = dict(zip(keys, resume.rows(f"{NAME}{'-quick' * quick}", keys, accuracy), strict=True))
    methods = [Method(f"moments {size}", "jflnr", jflnr.denoise, {"block": size}) for size in sizes]
    clock = times(methods, frames[0], quick)
    rows = []
    for key, values in found.items():
        way, size = key.split()
        row = {"way": way, "block": int(size), "psnr": float(np.mean(values))}
        rows.append(row | ({"ms": clock[key]} if key in clock else {}))
    return {"rows": rows}


def shrunk(frame: Frame, *, way: str, block: int) -> Array:
    """FLR with one model per block, of moments or of smaller inputs; `(H, W, 3)`."""
    if way == "moments":
        return jflnr.denoise(frame, block=block)
    if way == "mean":
        small = np.asarray(traced_at(frame, block).indirect)
    else:
        small = np.asarray(frame.indirect)[::block, ::block]
    return jflnr.denoise(dataclasses.replace(frame, indirect=small), block=block)


def draw(result: dict[str, Any], folder: Path) -> None:
    """block.png: PSNR of the three ways, and time; block.md."""
    rows = result["rows"]
    columns = {"way": "smaller", "block": "block", "psnr": "PSNR, dB", "ms": "ms, 640 x 360"}
    plots.write_text(folder / f"{NAME}.md", results.table(rows, columns))
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        start = next(row for row in rows if row["block"] == 1)
        for (way, label), style in zip(WAYS.items(), ("o-", "s--", "^:"), strict=True):
            mine = [row for row in rows if row["way"] == way and row["block"] > 1]
            mine = [start, *mine]
            left.plot([row["block"] for row in mine], [r["psnr"] for r in mine], style, label=label)
        timed = [row for row in rows if "ms" in row]
        right.plot([row["block"] for row in timed], [row["ms"] for row in timed], "o-")
        sizes = [row["block"] for row in timed]
        for axis in (left, right):
            axis.set(xscale="log", xlabel="block, pixels on a side")
            axis.set_xticks(sizes, map(str, sizes))
            axis.minorticks_off()
        left.set(ylabel="PSNR at 1 spp, dB")
        right.set(ylabel="milliseconds at 640 x 360", yscale="log")
        left.legend(fontsize=8, loc="lower left")
