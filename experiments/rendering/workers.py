"""`render data` on a Dask cluster: a frame is the unit, and only the client writes the manifest."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from experiments.rendering import backend
from experiments.rendering.manifest import Manifest
from experiments.rendering.splits import check_split
from jflnr.cluster import each

Facts = dict[str, Any]
# A job as it travels, its fields and its name: `Job` can only be loaded once Mitsuba has started.
Packed = tuple[tuple, str]


def fill(
    address: str,
    folder: Path,
    jobs: Iterator[Any],
    frames: int,
    threads: int | None,
    say: Callable[[str], None],
) -> int:
    """As `dataset.fill`, on the cluster at `address` ("" for this machine's cores).

    Raises ValueError at the end if frames failed; the others are there.
    """
    manifest, failures = Manifest(folder), list[str]()
    first = next(jobs)
    split, waiting = first.split, itertools.chain([first], jobs)
    work = functools.partial(_render, folder.resolve(), threads)
    while (missing := frames - manifest.count(split)) > 0:
        batch = list(
            itertools.islice((job for job in waiting if not manifest.done(job.name)), missing)
        )
        if not batch:
            break
        for job in batch:
            check_split(job.scene, split)
        names = [(dataclasses.astuple(job), job.name) for job in batch]
        for name, found in each(address, work, names, _failed):
            if isinstance(found, BaseException):
                failures.append(f"{name}: {found}")
            elif isinstance(found, str):
                manifest.skip(name, found)
            else:
                manifest.add(name, found)
            say(f"{name}: {manifest.count(split)} of {frames} frames")
        if failures:
            break
    if failures:
        raise ValueError("frames failed: " + "; ".join(failures))
    return manifest.count(split)


def _failed(job: Packed, error: BaseException) -> tuple[str, BaseException]:
    return job[1], error


def _render(folder: Path, threads: int | None, job: Packed) -> tuple[str, Facts | str]:
    """On a worker: the facts of a frame, or why there is none. One that exists is not repeated."""
    backend.start(threads)
    from experiments.rendering import dataset

    return job[1], dataset.render_job(folder, dataset.Job(*job[0]))
