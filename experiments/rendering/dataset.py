"""Fills a folder with training frames: resumable, split by scene, a manifest beside the frames."""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.rendering import frame, sequence
from experiments.rendering.manifest import Manifest
from experiments.rendering.reference import Goal
from experiments.rendering.sampling import stream_seed
from experiments.rendering.scenes.catalogue import CALM, FAMILIES
from experiments.rendering.source import RANDOM, load
from experiments.rendering.splits import TEST, TRAIN_ROOMS, VAL, check_split
from jflnr import read_header

NOISY = {
    "train": (1, 2, 4, 8, 16),
    "val": (1, 2, 4, 8, 16, 32, 64),
    "test": (1, 2, 4, 8, 16, 32, 64),
}
REALISATIONS = 4
ERROR = {"train": 0.06, "val": 0.02, "test": 0.02}
SECONDS_PER_PIXEL = 75 / (320 * 184)  # of a processor at most, for a reference
TWENTY_MINUTES = 2400.0  # of two cores
STRONG = 4  # rounds with strong colours; then come calm ones
# Views of which `shared/data` has noisier references.
STORED = {"bathroom": (0, 4), "staircase": (0, 1), "living-room-2": (0, 3), "living-room": (0, 1)}
# One sequence of every scene of val and test, and what moves in it.
MOTIONS = {
    "veach-lamp": "object",
    "dining-room": "camera",
    "sponza": "camera",
    "classroom": "object",
    "bathroom2": "camera",
}
LENGTH = 20  # frames of a sequence
SEQUENCE_GOAL = Goal(0.05, seconds=240)  # of each of its references


@dataclass(frozen=True)
class Job:
    """One frame to render; `split` is the folder that it goes to.

    With a `motion` it is the frame `number` of a sequence, in a folder of its own.
    """

    scene: str
    view: int
    width: int
    height: int
    split: str = "train"
    motion: str = ""
    number: int = 0

    @property
    def name(self) -> str:
        """The file's name in the folder, which tells jobs apart."""
        if self.motion:
            shot = f"{self.scene}_{self.motion}"
            return f"{self.split}/{shot}/{shot}_{self.number:03}.exr"
        size = "" if (self.width, self.height) == (320, 184) else f"_{self.width}x{self.height}"
        return f"{self.split}/{self.scene}_{self.view}{size}.exr"


def training_jobs() -> Iterator[Job]:
    """The views of `shared/data`, then rounds of new ones without end."""
    for scene, views in STORED.items():
        for view in views:
            yield Job(scene, view, 640, 360)
    for number in itertools.count():
        yield from _round(number)


def _round(number: int) -> Iterator[Job]:
    """A view of one scene of every family, of a second sunlit one and of one training room.

    Most real rooms are sunlit, and little light is found in them. Most frames are 320 x 184;
    those of every sixth round are 640 x 360, of every twelfth a quarter 1280 x 720.
    """
    room = TRAIN_ROOMS[number % len(TRAIN_ROOMS)]
    seed = number + (1 if number < STRONG else CALM)
    for index, name in enumerate([*(f"{f}-{seed}" for f in FAMILIES), f"sunlit-{seed + 999}"]):
        yield Job(name, RANDOM, *_size(number, index))
    yield Job(room, RANDOM + number // len(TRAIN_ROOMS), *_size(number, len(FAMILIES) + 1))


def evaluation_jobs(split: str) -> Iterator[Job]:
    """Of every scene of the splits val or test one 1920 x 1080 frame, then one sequence."""
    scenes = VAL if split == "val" else TEST
    for scene in scenes:
        yield Job(scene, 0, 1920, 1080, split)
    for scene, number in itertools.product(scenes, range(LENGTH)):
        yield Job(scene, 0, 640, 360, split, MOTIONS[scene], number)


def _size(number: int, index: int) -> tuple[int, int]:
    if number % 12 == 11 and index % 4 == number // 12 % 4:
        return 1280, 720
    return (640, 360) if number % 6 == 5 else (320, 184)


def settings_of(job: Job) -> frame.Settings:
    """Four 1-spp realisations and more, of a sequence one; the reference's goal."""
    if job.motion:
        seed = stream_seed(job.scene, job.view, job.motion)
        return frame.Settings(job.width, job.height, seed, goal=SEQUENCE_GOAL)
    many = job.split == "train" and job.view >= RANDOM
    seconds = SECONDS_PER_PIXEL * job.width * job.height if many else TWENTY_MINUTES
    return frame.Settings(
        job.width,
        job.height,
        stream_seed(job.scene, job.view, job.width),
        noisy=NOISY[job.split],
        realisations=REALISATIONS,
        direct_spp=64 if job.split == "train" else 256,
        goal=Goal(ERROR[job.split], seconds=seconds),
    )


def fill(
    folder: Path,
    jobs: Iterator[Job],
    frames: int | None,
    say: Callable[[str], None] = print,
) -> int:
    """Render jobs until `frames` of their split are there, or all; returns how many there are.

    Finished ones stay.

    Raises ValueError where a job's scene does not belong to the split it is to be written to.
    """
    manifest = Manifest(folder)
    start, made, there = time.monotonic(), 0, 0
    for job in jobs:
        there = manifest.count(job.split)
        if frames is not None and there >= frames:
            break
        check_split(job.scene, job.split)
        if manifest.done(job.name):
            continue
        found = render_job(folder, job)
        if isinstance(found, str):
            manifest.skip(job.name, found)
            say(f"{job.name}: no valid view")
            continue
        manifest.add(job.name, found)
        there, made = there + 1, made + 1
        error = manifest.entries[job.name]["reference_median_relative_standard_error"]
        line = f"{job.name}: error {error:.3f}"
        if frames is not None:
            left = (frames - there) * (time.monotonic() - start) / made / 60
            line += f"; {there} of {frames} frames, {left:.0f} minutes left"
        say(line)
    return there


_load = functools.lru_cache(maxsize=1)(load)


def render_job(folder: Path, job: Job) -> dict[str, Any] | str:
    """Render one job, unless its file is there; its facts, or why there is no such frame."""
    if (folder / job.name).exists():
        return _without_matrix(read_header(folder / job.name))
    source = _load(job.scene)
    if job.view < RANDOM and job.view not in source.own:
        return "the scene has no view of this number"
    found = source.view(job.view)
    if found is None:
        return "no valid view was found"
    camera, near = found
    state = folder / "state" / (job.name.replace("/", "_") + ".npz")
    settings = settings_of(job)
    if job.motion:
        shot = sequence.Shot.of(source, camera, job.motion, LENGTH)
        twin = folder / replace(job, number=shot.twin(job.number)).name
        layers, facts = sequence.render(shot, job.number, settings, near, twin, state)
    else:
        layers, facts = frame.render(source.scene, camera, settings, near, state)
    facts = {"scene": job.scene, "view": job.view, "split": job.split} | facts
    frame.write(folder / job.name, layers, facts)
    state.unlink(missing_ok=True)
    return _without_matrix(facts)


def _without_matrix(facts: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in facts.items() if k != "camera_to_world"}
