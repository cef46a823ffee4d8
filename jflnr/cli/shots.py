"""Shots: frames that are denoised in order, each with what the ones before it left.

That is not in the outputs. A run that was interrupted goes on from the file of `--history`, or else
from the shot's first frame, where it denoises once more what is there already without writing it.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jflnr import cluster
from jflnr.cli.common import refuse
from jflnr.cli.frames import Denoised, Given, Loaded, Record, Worker, failure
from jflnr.cli.jobs import Job, natural, pipelined
from jflnr.frame import Frame

if TYPE_CHECKING:
    from jflnr.history import History

# What a history depends on.
OPTIONS = (
    "method", "spp", "map", "guides", "params", "sigma", "eps", "eps_prime", "block", "worth"
)  # fmt: skip

UNKNOWN_MOTION = "Without a layer motion and a camera, everything is taken to stand still."


def wanted(arguments: argparse.Namespace) -> bool:
    """Whether frames are to be denoised as shots. Raises ValueError if something excludes that."""
    if not (arguments.temporal or arguments.history is not None or arguments.method == "bmfr"):
        return False
    alone = ("error_map", "explain", "profile", "lobes")
    refuse(arguments, alone, "is for frames by themselves, not shots")
    if arguments.backend == "opencl" and arguments.history is not None:
        raise ValueError("--history keeps what the jax backend remembers: leave out --backend")
    return True


def records(worker: Worker, jobs: Sequence[Job], arguments: argparse.Namespace) -> Iterator[Record]:
    """What becomes of the frames of all shots; on a cluster, a shot is what a worker is given."""
    shots = shots_of(jobs)
    if arguments.history is not None and len(shots) > 1:
        raise ValueError(
            f"--history is of one shot, and the frames are of {len(shots)} folders: "
            "give one folder, or leave --history out"
        )
    if arguments.cluster is None:
        return itertools.chain.from_iterable(_denoised(worker, shot) for shot in shots)
    whole = functools.partial(_finished, worker)  # which travels, as no lambda does
    failed = lambda shot, error: [failure(job, error) for job in shot]
    return itertools.chain.from_iterable(cluster.each(arguments.cluster, whole, shots, failed))


def shots_of(jobs: Iterable[Job]) -> list[list[Job]]:
    """The jobs of each folder, in natural order: one shot each."""
    shots: dict[Path, list[Job]] = {}
    for job in jobs:
        shots.setdefault(job.source.parent, []).append(job)
    return [sorted(shot, key=lambda job: natural(job.source)) for shot in shots.values()]


def _finished(worker: Worker, shot: Sequence[Job]) -> list[Record]:
    return list(_denoised(worker, shot))


def _denoised(worker: Worker, shot: Sequence[Job]) -> Iterator[Record]:
    """What becomes of each frame. Raises ValueError if the history is not that of this shot."""
    before = _before(worker.arguments)
    kept = [worker.kept(job) for job in shot]
    done = 0 if before is None else _frames_in(before, shot)
    if missing := [job for job, there in zip(shot[:done], kept, strict=False) if not there]:
        raise ValueError(
            f"{worker.arguments.history} is past {missing[0].source}, which has to be denoised: "
            "delete it, and the shot starts from its first frame"
        )
    last = max((i + 1 for i, there in enumerate(kept) if not there), default=done)
    running = _Running(worker, before, {} if before is None else before.about["header"])
    yield from (record for record in kept[:done] if record)
    yield from pipelined(shot[done:last], running.read, running.denoise, running.write)
    yield from (record for record in kept[last:] if record)


def _before(arguments: argparse.Namespace) -> History | None:
    """What an earlier run left in the file of `--history`, if it was like this one."""
    from jflnr import history

    if arguments.history is None or not arguments.history.exists():
        return None
    found = history.read(arguments.history)
    for name, value in _options(arguments).items():
        if (other := found.about["options"].get(name, "None")) != value:
            option = f"--{name.replace('_', '-')}"
            made, now = (
                f"without {option}" if chosen == "None" else f"with {option} {chosen}"
                for chosen in (other, value)
            )
            raise ValueError(
                f"{arguments.history} was made {made}, and this is {now}: delete it, or name "
                "another file"
            )
    return found


@dataclass
class _Running:
    """A shot on its way. state: after the last frame that was denoised; header: that of the last
    frame that was read."""

    worker: Worker
    before: History | None
    header: dict[str, Any]
    state: Any = None
    failed: bool = False

    def read(self, job: Job) -> Loaded | Record:
        """The frame, with motion from the cameras if it has none of its own."""
        loaded = self.worker.load(job)
        if isinstance(loaded, dict):
            return loaded
        if loaded.source is None or loaded.frame is None:
            return failure(job, ValueError("a shot needs whole frames in memory: raise --memory"))
        from jflnr.temporal.camera import with_motion

        header, self.header = self.header, loaded.source.header
        return loaded._replace(frame=with_motion(loaded.frame, self.header, header))

    def denoise(self, loaded: Loaded | Record) -> tuple[Denoised | Record, Any]:
        """The denoised frame, and the state after it."""
        denoised = self.worker.denoise(loaded, self._next)
        if isinstance(denoised, Denoised):
            self.state = self.worker.denoiser.state
        return denoised, self.state

    def _next(self, frame: Frame) -> Given:
        denoiser = self.worker.denoiser
        denoiser.state = self.state
        if self.state is None and self.before is not None:
            denoiser.state = self.before.state(denoiser.start(frame))
        if frame.motion is None:
            warnings.warn(UNKNOWN_MOTION, stacklevel=1)
            frame = dataclasses.replace(frame, motion=np.zeros((*frame.depth.shape[:2], 2)))
        return {"image": denoiser.next(frame)}

    def write(self, done: tuple[Denoised | Record, Any]) -> Record:
        """Write the frame, unless it is there, then the history, so that it is never ahead."""
        from jflnr import history

        denoised, state = done
        if isinstance(denoised, dict):
            self.failed = True  # from here on the history would hide that a frame is missing
            return denoised
        record = self.worker.kept(denoised.job) or self.worker.write(denoised)
        self.failed = self.failed or "error" in record
        arguments, source = self.worker.arguments, denoised.source
        if arguments.history is not None and not self.failed:
            about = {"options": _options(arguments), "last": _identity(source.path)}
            history.write(arguments.history, state, about | {"header": source.header})
        return record


def _options(arguments: argparse.Namespace) -> dict[str, str]:
    return {name: str(getattr(arguments, name)) for name in OPTIONS}


def _identity(path: Path) -> list[Any]:
    """What tells a frame's file from one that took its place."""
    status = path.stat()
    return [path.name, status.st_size, status.st_mtime_ns]


def _frames_in(before: History, shot: Sequence[Job]) -> int:
    """How many of the shot's frames are in the history; 0 if it ends with another one's frame."""
    for i, job in enumerate(shot):
        if job.source.exists() and _identity(job.source) == before.about["last"]:
            return i + 1
    return 0
