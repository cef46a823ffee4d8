"""Frames larger than memory, whole and in pieces; folders of frames."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from experiments import crop, folders, mosaic, plots, resume
from experiments.results import Parts
from jflnr.large import memory
from jflnr.methods import method_of
from jflnr.regression.flr import FLR

NAME = "large"
QUESTION = "What do large frames and folders of frames take, in memory and in time?"
MINUTES = 25

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


def run(quick: bool) -> Parts:
    """Memory and time by size and method, crops of the largest frame; folders of frames."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if quick:
            return {"memory": _sizes(folder, "flr", *SIZES[0])} | folders.run(quick)
        keys = [f"{method} {h} {w}" for h, w in SIZES for method in METHODS]
        sizes = resume.rows(NAME, keys, lambda key: _sizes(folder, *_parsed(key)))
        largest = resume.rows(f"{NAME}-largest", CROPPED, lambda method: _largest(folder, method))
    found = {"memory": [row for rows in sizes for row in rows], "largest": largest}
    return found | folders.run(quick)


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
    tile = memory.tile_for(*LARGEST, memory.parse(LARGEST_MEMORY), 1, method_of(method))
    assert tile is not None
    found |= crop.difference(source, output, method, seam(method, tile))
    return {"method": method, "megapixels": LARGEST[0] * LARGEST[1] / 1e6, **found}


def seam(method: str, tile: int) -> tuple[int, int]:
    """Row and column, near the middle of the largest frame, where pieces meet."""
    height, width = LARGEST
    if method == "flr":
        strip = -(-(tile * tile // width) // FLR.block) * FLR.block
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


def charts(parts: Parts, folder: Path) -> None:
    """large.png: memory and time by size."""
    rows = [row | {"case": f"{row['method']}, {row['way']}"} for row in parts["memory"]]
    plots.lines(folder / f"{NAME}.png", rows, x="megapixels", y=("MB", "seconds"), by="case")
