"""Which frames a command line means, where their results go, and how they pass."""

import math
import os
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from jflnr.layouts.override import elsewhere

# What a frame can be written as, and what it cannot.
FILES = (".exr", ".pfm")
PICTURES = (".png", ".jpg", ".jpeg", ".hdr", ".tif", ".tiff")


@dataclass(frozen=True)
class Job:
    """One frame to read, and the file to write."""

    source: Path
    target: Path

    @property
    def previews(self) -> dict[str, Path]:
        """By the option that asks for them."""
        return {"png": self.target.with_suffix(".png"), "jpeg": self.target.with_suffix(".jpg")}

    @property
    def explanation(self) -> Path:
        return self.target.with_suffix(".plan.png")

    @property
    def files(self) -> tuple[Path, ...]:
        """All that may be written."""
        return self.target, *self.previews.values(), self.explanation


def expand(inputs: Sequence[Path]) -> list[Path]:
    """The EXR files meant: a file stands for itself, a folder for the `*.exr` in it, in order."""
    files: list[Path] = []
    for path in inputs:
        found = frames_in(path) if path.is_dir() else [path]
        if not found:
            raise ValueError(f"{path}: there is no EXR file in this folder")
        files += found
    return files


def frames_in(folder: Path) -> list[Path]:
    """The EXR files in a folder, in order."""
    return sorted((p for p in folder.glob("[!.]*") if p.suffix.lower() == ".exr"), key=natural)


def natural(path: Path) -> list[tuple[float, str]]:
    """What to sort by so that `f_2.exr` comes before `f_10.exr`."""
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part), "") if part.isdecimal() else (math.inf, part) for part in parts]


def plan(inputs: Sequence[Path], output: Path) -> list[Job]:
    """One job per frame, its output apart from all that is read; raises ValueError."""
    files = expand(inputs)
    as_file = output.suffix.lower() in FILES and not output.is_dir()
    if as_file and (len(inputs) > 1 or inputs[0].is_dir()):
        raise ValueError(f"{output}: OUT must be a folder when there are several frames")
    if not as_file and output.suffix.lower() in PICTURES:
        raise ValueError(
            f"{output}: OUT must end with .exr or .pfm or be a folder (--png or --jpeg: a preview)"
        )
    jobs = [Job(file, output if as_file else output / f"{file.stem}.exr") for file in files]
    check_apart((job.target for job in jobs), files)
    sources: dict[Path, Path] = {}
    for job in jobs:
        if (other := sources.setdefault(job.target, job.source)) is not job.source:
            raise ValueError(f"{other} and {job.source} would both be written to {job.target}")
    return jobs


def make_folder(target: Path) -> None:
    """Make the folder that `target` goes to, and see that it takes files, before any work."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=target.parent).close()
    except OSError as error:
        raise OSError(f"{target} cannot be written: {error.strerror}") from None


def borrowed(layers: Iterable[tuple[str, str]], sources: Iterable[Path]) -> list[Path]:
    """The other files that `--map` takes layers of the frames `sources` from."""
    found = (elsewhere(value, source) for source in sources for _, value in layers)
    return [there[0] for there in found if there]


def check_apart(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise ValueError if an output is also an input; None stands for no file."""
    given = {_identity(path) for path in inputs if path is not None}
    for path in outputs:
        if path is not None and _identity(path) in given:
            raise ValueError(f"{path}: this output would replace an input")


def _identity(path: Path) -> tuple[int, int] | Path:
    """What two names of one file have in common."""
    if not path.exists():
        return Path(os.path.realpath(path))  # which takes links that lead nowhere
    status = path.stat()
    return status.st_dev, status.st_ino


def pipelined(
    jobs: Iterable[Any],
    read: Callable[[Any], Any],
    work: Callable[[Any], Any],
    write: Callable[[Any], Any],
) -> Iterator[Any]:
    """What `write(work(read(job)))` returns, job by job; meanwhile the next is read and the last
    written.

    `work` runs here, the others on a thread of their own each; at most three jobs are under way.
    """
    waiting, reads, writes = iter(jobs), list[Future](), list[Future]()
    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer:
        coming = lambda: [reader.submit(read, job) for job in islice(waiting, 1)]
        try:
            reads = coming()
            while reads:
                found, reads = reads[0].result(), coming()
                done = work(found)
                yield from (writing.result() for writing in writes)
                writes = [writer.submit(write, done)]
            yield from (writing.result() for writing in writes)
        finally:
            for future in (*reads, *writes):
                future.cancel()
