"""Fills a folder with training frames: resumable, split by scene, a manifest beside the frames."""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.rendering import frame, pictures, sequence
from experiments.rendering.manifest import Manifest
from experiments.rendering.reference import Goal
from experiments.rendering.sampling import stream_seed
from experiments.rendering.scenes.catalogue import CALM, FAMILIES
from experiments.rendering.source import RANDOM, load
from experiments.rendering.splits import TEST, TRAIN_ROOMS, VAL, check_split
from jflnr import read_header

# Training frames are many rather than good: their references are what denoising them leaves.
TRAINING, SAMPLES = (1, 1, 1, 1, 4, 4, 16, 16), 96
VIEWS = 12  # whole pictures of each scene of val and test
NARROW = 0.6  # of every second training view's field of view: as a part of a larger frame
NOISY = (1, 2, 4, 8, 16, 32, 64, 1, 1, 1)
ERROR = 0.02
TWENTY_MINUTES = 2400.0  # of two cores
FIRST = 500  # seed of the first training scenes
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

    With a `motion` it is the frame `number` of a sequence, in a folder of its own. A `whole`
    picture has all light and materials of all kinds.
    """

    scene: str
    view: int
    width: int
    height: int
    split: str = "train"
    motion: str = ""
    number: int = 0
    whole: bool = False

    @property
    def name(self) -> str:
        """The file's name in the folder, which tells jobs apart."""
        if self.motion:
            shot = f"{self.scene}_{self.motion}"
            return f"{self.split}/{shot}/{shot}_{self.number:03}.exr"
        size = "" if (self.width, self.height) == (320, 184) else f"_{self.width}x{self.height}"
        return f"{self.split}/{self.scene}_{self.view}{size}.exr"


def training_jobs() -> Iterator[Job]:
    """Two views of a scene of every family, of a second sunlit one and of a room, without end.

    Every second round has calm colours. Most real rooms are sunlit, and little light is found in
    them.
    """
    for number in itertools.count():
        seed = FIRST + number + CALM * (number % 2)
        room = TRAIN_ROOMS[number % len(TRAIN_ROOMS)]
        for scene in [*(f"{f}-{seed}" for f in FAMILIES), f"sunlit-{seed + 999}"]:
            yield from (Job(scene, RANDOM + i, 320, 184) for i in range(2))
        yield from (Job(room, RANDOM + 50 + 2 * number + i, 320, 184) for i in range(2))


def evaluation_jobs(split: str) -> Iterator[Job]:
    """Of every scene of the splits val or test one 1920 x 1080 frame, then one sequence."""
    scenes = VAL if split == "val" else TEST
    for scene in scenes:
        yield Job(scene, 0, 1920, 1080, split)
    for scene, number in itertools.product(scenes, range(LENGTH)):
        yield Job(scene, 0, 640, 360, split, MOTIONS[scene], number)


def picture_jobs(split: str) -> Iterator[Job]:
    """Whole pictures: the views of the training frames, or a few of each scene of val and test.

    After every fourth training picture there is one of a scene in the air.
    """
    if split == "train":
        for number, job in enumerate(training_jobs()):
            yield replace(job, whole=True)
            if number % 4 == 3:
                yield Job(f"airy-{FIRST + number // 4}", 0, 320, 184, whole=True)
        return
    for view, scene in itertools.product(range(VIEWS), VAL if split == "val" else TEST):
        yield Job(scene, RANDOM + view, 320, 184, split, whole=True)


def settings_of(job: Job) -> frame.Settings:
    """The noisy layers of a job, and the goal of its reference."""
    if job.motion:
        seed = stream_seed(job.scene, job.view, job.motion)
        return frame.Settings(job.width, job.height, seed, goal=SEQUENCE_GOAL)
    seed = stream_seed(job.scene, job.view, job.width)
    if job.split == "train":
        goal = Goal(0.0, SAMPLES, SAMPLES)
        return frame.Settings(job.width, job.height, seed, TRAINING, direct_spp=1, goal=goal)
    goal = Goal(ERROR, seconds=TWENTY_MINUTES)
    return frame.Settings(job.width, job.height, seed, NOISY, direct_spp=256, goal=goal)


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


def narrowed(fov_x: float) -> float:
    """The angle that `NARROW` of a picture's width covers, in degrees."""
    return float(np.degrees(2 * np.arctan(NARROW * np.tan(np.radians(fov_x) / 2))))


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
    if (job.split == "train" or job.whole) and job.view % 2:
        camera = camera._replace(fov_x=narrowed(camera.fov_x))
    facts = {"scene": job.scene, "view": job.view, "split": job.split}
    if job.whole:
        seed = stream_seed(job.scene, job.view, "whole")
        layers, made = pictures.render(source, camera, seed, job.width, job.height)
        frame.write(folder / job.name, layers, facts | made)
        return _without_matrix(facts | made)
    state = folder / "state" / (job.name.replace("/", "_") + ".npz")
    settings = settings_of(job)
    if job.motion:
        shot = sequence.Shot.of(source, camera, job.motion, LENGTH)
        twin = folder / replace(job, number=shot.twin(job.number)).name
        layers, made = sequence.render(shot, job.number, settings, near, twin, state)
    else:
        layers, made = frame.render(source.scene, camera, settings, near, state)
    frame.write(folder / job.name, layers, facts | made)
    state.unlink(missing_ok=True)
    return _without_matrix(facts | made)


def _without_matrix(facts: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in facts.items() if k != "camera_to_world"}
