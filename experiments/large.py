"""Frames larger than memory: what they take whole and in pieces, and whether a seam shows."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np

import jflnr
from experiments import crop, data, mosaic, plots, results, resume
from jflnr.files import replacing
from jflnr.large import memory
from jflnr.metrics import display, exposure

NAME = "large"
QUESTION = "What do large frames take, in memory and in time, whole and in pieces?"
MINUTES = 20

METHODS = ("flr", "flr-adaptive", "flnr")
# Pixels of the frames whose memory is measured, and what they may take in pieces.
SIZES = ((1080, 1920), (2160, 3840), (4320, 7680))
MEMORY = "2300M"
# A frame that does not fit, and the methods of which a crop can be denoised by itself.
LARGEST, LARGEST_MEMORY = (8192, 16384), "4G"
CROPPED = ("flr", "flr-adaptive")
# Runs one command line and says what it took: peak memory is a process's own.
MEASURED = """
import json, resource, sys, time
from jflnr.cli import main
start = time.perf_counter()
code = main(sys.argv[1:])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"code": code, "MB": peak / 1024, "seconds": time.perf_counter() - start,
                  "cpu": time.process_time()}))
"""


def run(quick: bool) -> dict[str, Any]:
    """Memory and time by size and method, and crops of the largest frame."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if quick:
            return {"memory": _sizes(folder, "flr", *SIZES[0]), "largest": []}
        keys = [f"{method} {h} {w}" for h, w in SIZES for method in METHODS]
        sizes = resume.rows(NAME, keys, lambda key: _sizes(folder, *_parsed(key)))
        largest = resume.rows(f"{NAME}-largest", CROPPED, lambda method: _largest(folder, method))
    return {"memory": [row for rows in sizes for row in rows], "largest": largest}


def _parsed(key: str) -> tuple[str, int, int]:
    method, height, width = key.split()
    return method, int(height), int(width)


def _sizes(folder: Path, method: str, height: int, width: int) -> list[dict[str, Any]]:
    """A frame of one size, whole and in pieces."""
    source = _mosaic(folder, height, width)
    rows = []
    for way, bound in (("whole", "100G"), ("in pieces", MEMORY)):
        found = _denoised(source, folder / "out.exr", method, bound)
        rows.append({"method": method, "way": way, "megapixels": height * width / 1e6, **found})
    return rows


def _largest(folder: Path, method: str) -> dict[str, Any]:
    """The largest frame in pieces, and a crop of it around a place where these meet."""
    source, output = _mosaic(folder, *LARGEST), folder / "out.exr"
    found = _denoised(source, output, method, LARGEST_MEMORY)
    tile = memory.tile_for(*LARGEST, memory.parse(LARGEST_MEMORY), method=method)
    assert tile is not None
    found |= crop.difference(source, output, method, seam(method, tile))
    return {"method": method, "megapixels": LARGEST[0] * LARGEST[1] / 1e6, **found}


def seam(method: str, tile: int) -> tuple[int, int]:
    """Row and column, near the middle of the largest frame, where pieces meet."""
    height, width = LARGEST
    if method == "flr":
        strip = -(-(tile * tile // width) // crop.BLOCK) * crop.BLOCK
        return height // 2 // strip * strip, width // 2
    return height // 2 // tile * tile, width // 2 // tile * tile


def _mosaic(folder: Path, height: int, width: int) -> Path:
    path = folder / f"{height}x{width}.exr"
    if not path.exists():
        mosaic.write(path, height, width)
    return path


def _denoised(source: Path, output: Path, method: str, bound: str) -> dict[str, Any]:
    options = ["--method", method, "--memory", bound, "--overwrite", "--json"]
    return measured(["denoise", str(source), "-o", str(output), *options])


def measured(arguments: list[str]) -> dict[str, Any]:
    """Peak memory, seconds and processor seconds of a command line in a process of its own."""
    command = [sys.executable, "-c", MEASURED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    if found.pop("code"):
        raise ValueError(f"jflnr {' '.join(arguments)}: {done.stderr.strip()}")
    return found


def seams(path: Path) -> None:
    """Whole, in pieces, and in strips that know nothing of each other; below, what differs."""
    frame = jflnr.read_frame(data.SHIPPED)
    whole = np.asarray(jflnr.denoise(frame))
    rows = 48
    apart = [
        jflnr.denoise(jax.tree.map(lambda a, top=top: a[top : top + rows], frame))
        for top in range(0, whole.shape[0], rows)
    ]
    tile = int((rows * whole.shape[1]) ** 0.5)
    pictures = {
        "whole": whole,
        f"in pieces (tile={tile})": np.asarray(jflnr.denoise(frame, tile=tile)),
        "strips apart: what a seam is": np.concatenate(apart),
    }
    scale = exposure(whole * frame.albedo)
    drawing, axes = plt.subplots(2, 3, figsize=(12, 5), layout="constrained")
    for (top, bottom), (name, light) in zip(axes.T, pictures.items(), strict=True):
        top.imshow(display(light * frame.albedo, scale))
        difference = np.abs(light - whole).mean(axis=-1) / whole.mean()
        bottom.imshow(difference, vmin=0, vmax=0.02, cmap="gray")
        top.set(title=name, xticks=[], yticks=[])
        text = f"difference: at most {difference.max():.1g} of the mean (white: 0.02)"
        bottom.set(xlabel=text, xticks=[], yticks=[])
    with replacing(path) as beside:
        drawing.savefig(beside, dpi=80, format="png")
    plt.close(drawing)


def draw(result: dict[str, Any], folder: Path) -> None:
    """large.png: memory and time by size; large_seams.png; large_figures.md."""
    seams(folder / f"{NAME}_seams.png")
    columns = {"method": "method", "way": "denoised", "megapixels": "megapixels"}
    taken = {"MB": "peak memory, MB", "seconds": "seconds", "cpu": "processor seconds"}
    text = results.table(result["memory"], columns | taken)
    if result["largest"]:
        text += f"\nIn pieces, `--memory {LARGEST_MEMORY}`, and a crop where pieces meet:\n\n"
        found = {"difference": "against the whole", "largest": "largest, of the mean"}
        columns = {"method": "method", "megapixels": "megapixels"}
        text += results.table(result["largest"], columns | taken | found)
    plots.write_text(folder / f"{NAME}_figures.md", text)
    with plots.figure(folder / f"{NAME}.png", columns=2, size=(5, 3.8)) as axes:
        for axis, key in zip(axes, ("MB", "seconds"), strict=True):
            for method in dict.fromkeys(row["method"] for row in result["memory"]):
                for way, style in (("whole", "o-"), ("in pieces", "s--")):
                    rows = [r for r in result["memory"] if (r["method"], r["way"]) == (method, way)]
                    x, y = [r["megapixels"] for r in rows], [r[key] for r in rows]
                    axis.plot(x, y, style, label=f"{method}, {way}")
            axis.set(xlabel="megapixels", ylabel=taken[key], ylim=(0, None))
        axes[0].legend(fontsize=7)
