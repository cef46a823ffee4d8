"""Frames larger than memory, folders of frames, and workers: what each costs."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import matplotlib.pyplot as plt
import numpy as np

import jflnr
from experiments import data, mosaic, plots, results
from jflnr.cli import parser
from jflnr.cli.frames import Denoiser, failure
from jflnr.cli.jobs import Job, plan
from jflnr.cli.pipeline import pipelined
from jflnr.cli.settings import settings_of
from jflnr.cluster import each, local_cluster
from jflnr.files import replacing
from jflnr.metrics import display, exposure

NAME = "large"
QUESTION = "What do large frames, many frames and several workers take, in memory and in time?"

METHODS = ("flr", "flr-adaptive")
BACKENDS = ("jax", "opencl")
# Pixels of the frames whose memory is measured, and what they may take in pieces.
SIZES = ((1080, 1920), (2160, 3840), (4320, 7680))
MEMORY = "1500M"
WORKERS = (1, 2)
FRAMES = 60
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
    """Memory and time by size; frames per second of a folder by what runs it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sizes = SIZES[:1] if quick else SIZES
        memory = [row for size in sizes for row in _sizes(folder, *size)]
        shot = folder / "shot"
        _shot(shot, 4 if quick else FRAMES, *((180, 320) if quick else (720, 1280)))
        return {
            "memory": memory,
            "pipeline": [row for backend in BACKENDS for row in _pipeline(shot, backend)],
            "workers": _workers(shot),
            "killed": _killed(shot),
        }


def _sizes(folder: Path, height: int, width: int) -> list[dict[str, Any]]:
    """A frame of one size by every method, whole and in pieces."""
    source = folder / "frame.exr"
    mosaic.write(source, height, width)
    rows = []
    for method in METHODS:
        for way, memory in (("whole", "100G"), ("in pieces", MEMORY)):
            options = ["--method", method, "--memory", memory, "--overwrite", "--json"]
            found = measured(["denoise", str(source), "-o", str(folder / "out.exr"), *options])
            megapixels = height * width / 1e6
            rows.append({"method": method, "way": way, "megapixels": megapixels, **found})
    return rows


def measured(arguments: list[str]) -> dict[str, Any]:
    """Peak memory, seconds and processor seconds of a command line in a process of its own."""
    command = [sys.executable, "-c", MEASURED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _shot(folder: Path, count: int, height: int, width: int) -> None:
    """Frames of a shot: cuts of a mosaic, every one another part of it."""
    folder.mkdir()
    for number in range(count):
        mosaic.write(folder / f"{number:04}.exr", height, width, first=number)


def _denoiser(*options: str) -> Denoiser:
    arguments = parser().parse_args(["denoise", "none", "-o", "none", "--overwrite", *options])
    return Denoiser(settings_of(arguments), arguments, None, 3)


def _pipeline(shot: Path, backend: str) -> list[dict[str, Any]]:
    """Frames per second: the work alone, the files alone, and both at once."""
    denoiser = _denoiser("--backend", backend)
    with tempfile.TemporaryDirectory() as out:
        jobs = plan([shot], Path(out))[:20]
        loaded = [denoiser.read(job) for job in jobs]
        ready = dict(zip(jobs, map(denoiser.denoise, loaded), strict=True))
        read = lambda job: (denoiser.read(job), job)[1]
        every = lambda *stages: list(pipelined(jobs, *stages))
        ways: dict[str, Callable[[], Any]] = {
            "work alone": lambda: [denoiser.denoise(one) for one in loaded],
            "EXR alone, in a loop": lambda: [denoiser.write(ready[read(job)]) for job in jobs],
            "EXR alone, on two threads": lambda: every(read, ready.get, denoiser.write),
            "one after another": lambda: [denoiser(job) for job in jobs],
            "pipeline": lambda: every(denoiser.read, denoiser.denoise, denoiser.write),
        }
        return [{"backend": backend, "what": n, **_rate(jobs, way)} for n, way in ways.items()]


def _rate(jobs: list[Job], work: Callable[[], Any]) -> dict[str, float]:
    """Frames a second, and what a frame takes of all processors together, in milliseconds."""
    start, busy = time.perf_counter(), time.process_time()
    work()
    rate = len(jobs) / (time.perf_counter() - start)
    return {"rate": rate, "cpu": 1000 * (time.process_time() - busy) / len(jobs)}


def _workers(shot: Path) -> list[dict[str, Any]]:
    """Frames per second of one process alone and of Dask workers on this machine, all warm."""
    rows = []
    with tempfile.TemporaryDirectory() as out:
        jobs, alone = plan([shot], Path(out)), dataclasses.replace(_denoiser(), compiled=None)
        one = lambda: list(pipelined(jobs, alone.read, alone.denoise, alone.write))
        one()
        rows.append({"workers": 0, **_rate(jobs, one)})
        for count in WORKERS:
            with local_cluster(count) as local:
                every = lambda to=local.scheduler_address: list(each(to, alone, jobs, failure))
                every()
                rows.append({"workers": count, **_rate(jobs, every)})
    return rows


def _killed(shot: Path) -> dict[str, Any]:
    """Two workers, one of which is killed half way, against one process alone."""
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        denoiser = dataclasses.replace(_denoiser(), compiled=None)
        for job in plan([shot], Path(one)):
            denoiser(job)
        jobs, records = plan([shot], Path(two)), []
        with local_cluster(2) as local:
            for record in each(local.scheduler_address, denoiser, jobs, failure):
                records.append(record)
                if len(records) == len(jobs) // 2:
                    os.kill(local.workers[0].pid, signal.SIGKILL)
        names = sorted(job.target.name for job in jobs)
        same = [
            (Path(one) / name).read_bytes() == (Path(two) / name).read_bytes() for name in names
        ]
        return {
            "frames": len(jobs),
            "reported once": sorted(Path(r["output"]).name for r in records) == names,
            "failed": sum("error" in record for record in records),
            "files": len(os.listdir(two)),
            "identical": sum(same),
        }


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
    """large.png: memory and time by size, frames per second; large_seams.png; large_figures.md."""
    seams(folder / f"{NAME}_seams.png")
    columns = {
        "method": "method",
        "way": "denoised",
        "megapixels": "megapixels",
        "MB": "peak memory, MB",
        "seconds": "seconds",
    }
    text = results.table(result["memory"], columns)
    columns = {
        "backend": "back end",
        "what": "a folder of frames",
        "rate": "frames/s",
        "cpu": "processor ms a frame",
    }
    text += "\n" + results.table(result["pipeline"], columns)
    text += "\n" + results.table(result["workers"], {"workers": "workers", "rate": "frames/s"})
    text += "\n" + results.table([result["killed"]], {name: name for name in result["killed"]})
    plots.write_text(folder / f"{NAME}_figures.md", text)
    with plots.figure(folder / f"{NAME}.png", columns=3, size=(4.2, 3.6)) as (left, middle, right):
        for axis, key, label in ((left, "MB", "peak memory, MB"), (middle, "seconds", "seconds")):
            for method in METHODS:
                for way, style in (("whole", "o-"), ("in pieces", "s--")):
                    rows = [r for r in result["memory"] if (r["method"], r["way"]) == (method, way)]
                    x, y = [r["megapixels"] for r in rows], [r[key] for r in rows]
                    axis.plot(x, y, style, label=f"{method}, {way}")
            axis.set(xlabel="megapixels", ylabel=label, ylim=(0, None))
        left.legend(fontsize=7)
        workers = [row for row in result["workers"] if row["workers"]]
        alone = next(row["rate"] for row in result["workers"] if not row["workers"])
        right.plot([r["workers"] for r in workers], [r["rate"] for r in workers], "o-")
        right.axhline(alone, linestyle="--", color="black", label="one process alone")
        right.set(xlabel="Dask workers", ylabel="frames a second", ylim=(0, None))
        right.set_xticks([row["workers"] for row in workers])
        right.legend(fontsize=7)
