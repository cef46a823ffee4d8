"""Folders of frames: the pipeline against its parts, and Dask workers, one of which is killed."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from experiments import mosaic
from experiments.results import Parts
from jflnr.cli import parser
from jflnr.cli.frames import Worker, failure
from jflnr.cli.jobs import Job, pipelined, plan
from jflnr.cli.settings import settings_of
from jflnr.cluster import cores, each, local_cluster
from jflnr.large import memory

CASES = (
    ("flr", "jax"),
    ("flr", "opencl"),
    ("flr-adaptive", "jax"),
    ("flr-adaptive", "opencl"),
    ("flnr", "jax"),
)
FRAMES, PIPELINED = 60, 20
WORKERS = (1, 2)


def run(quick: bool) -> Parts:
    """Frames per second of a folder by what runs it, and what a killed worker loses."""
    memory.keep_freed()  # as `jflnr denoise` does
    with tempfile.TemporaryDirectory() as name:
        shot = Path(name) / "shot"
        _write_shot(shot, 4 if quick else FRAMES, *((180, 320) if quick else (720, 1280)))
        return {
            "pipeline": [_pipeline(shot, *case) for case in (CASES[:2] if quick else CASES)],
            "workers": _workers(shot),
            "one of two workers killed": [_killed(shot)],
        }


def _write_shot(folder: Path, count: int, height: int, width: int) -> None:
    """Cuts of a mosaic of real frames, every one another part of it."""
    folder.mkdir()
    for number in range(count):
        mosaic.write(folder / f"{number:04}.exr", height, width, first=number)


def _denoiser(*options: str) -> Worker:
    arguments = parser().parse_args(["denoise", "none", "-o", "none", "--overwrite", *options])
    return Worker(settings_of(arguments), arguments, None, 3)


def _pipeline(shot: Path, method: str, backend: str) -> dict[str, Any]:
    """Frames per second of the work alone, of the files alone and of both at once.

    files: read and written on a thread each, as the pipeline does. half: on half of the cores, what
    a part has when both run at once. slower: the pipeline's rate by that of the slower part. bound:
    what is possible where both parts alone keep all cores busy. busy: how much the pipeline does.
    """
    denoiser = _denoiser("--method", method, "--backend", backend)
    with tempfile.TemporaryDirectory() as out:
        jobs = plan([shot], Path(out))[:PIPELINED]
        loaded = [denoiser.read(job) for job in jobs]
        ready = dict(zip(jobs, map(denoiser.denoise, loaded), strict=True))
        read = lambda job: (denoiser.read(job), job)[1]
        work = lambda: [denoiser.denoise(one) for one in loaded]
        files = lambda: list(pipelined(jobs, read, ready.get, denoiser.write))
        found = {"work": _measure(jobs, work), "files": _measure(jobs, files)}
        with _half_the_cores():
            found |= {"work_half": _measure(jobs, work), "files_half": _measure(jobs, files)}
        found["loop"] = _measure(jobs, lambda: [denoiser(job) for job in jobs])
        stages = denoiser.read, denoiser.denoise, denoiser.write
        found["pipeline"] = _measure(jobs, lambda: list(pipelined(jobs, *stages)))
    rates = {name: one["rate"] for name, one in found.items()}
    times = {f"{name}_ms": found[name]["cpu"] for name in ("work", "files", "pipeline")}
    return {
        "method": method,
        "backend": backend,
        **rates,
        **times,
        "slower": rates["pipeline"] / min(rates["work"], rates["files"]),
        "slower_half": rates["pipeline"] / min(rates["work_half"], rates["files_half"]),
        "bound": 1 / (1 / rates["work"] + 1 / rates["files"]),
        "busy": rates["pipeline"] * times["pipeline_ms"] / 1000 / cores(),
    }


@contextlib.contextmanager
def _half_the_cores() -> Iterator[None]:
    """All threads of this process on the first half of the cores that it may use."""
    every = sorted(os.sched_getaffinity(0))
    try:
        _confine(every[: max(len(every) // 2, 1)])
        yield
    finally:
        _confine(every)


def _confine(numbers: list[int]) -> None:
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(ProcessLookupError):  # it may have ended
            os.sched_setaffinity(int(thread), numbers)


def _measure(jobs: list[Job], work: Callable[[], Any]) -> dict[str, float]:
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
        rows.append({"workers": 0, **_measure(jobs, one)})
        for count in WORKERS:
            with local_cluster(count) as local:
                every = lambda to=local.scheduler_address: list(each(to, alone, jobs, failure))
                every()
                rows.append({"workers": count, **_measure(jobs, every)})
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
