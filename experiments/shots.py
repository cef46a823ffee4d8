"""Sequences to measure on, and every way to denoise one."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data
from experiments.methods import oidn_peers
from experiments.peers import svgf
from jflnr import temporal
from jflnr.bmfr.pipeline import BMFR
from jflnr.cli.jobs import expand
from jflnr.frame import Array, Frame

Step = Callable[[Any, Frame], tuple[Any, Array]]

# Our spatial methods, which all work with a history.
SPATIAL = tuple(name for name in jflnr.METHODS if name != "bmfr")


@dataclass(frozen=True)
class Shot:
    """A sequence. motion: static, camera, light, switch or object. split: of its scene."""

    name: str
    scene: str
    motion: str
    split: str
    frames: tuple[Frame, ...]


def folder() -> Path:
    """JFLNR_SEQUENCES, else where `render shots` puts them."""
    default = Path(__file__).parents[1] / "cache" / "sequences"
    return Path(os.environ.get("JFLNR_SEQUENCES", default))


def names() -> list[str]:
    """The sequences that are there; `made up` if there are none."""
    found = sorted(path.parent.name for path in folder().glob("*/manifest.json"))
    if not found:
        print(f"No sequences in {folder()} (`render shots` makes them): using a made-up one.")
    return found or ["made up"]


@functools.lru_cache(maxsize=1)
def load(name: str) -> Shot:
    """The sequence of a name."""
    if name == "made up":
        return made_up()
    paths = expand([folder() / name])
    facts = jflnr.read_header(paths[0])
    frames = tuple(data.read(path) for path in paths)
    return Shot(name, facts["scene"], facts["motion"], facts["split"], frames)


def made_up(length: int = 10, height: int = 48, width: int = 80) -> Shot:
    """A window that slides over the frame that ships, with noise of its own in every frame."""
    whole = data.read(data.SHIPPED)
    frames = []
    for i in range(length):
        rows, columns = slice(90, 90 + height), slice(150 + 2 * i, 150 + 2 * i + width)
        part = whole.map(lambda layer: layer[rows, columns])  # noqa: B023
        light = np.asarray(part.reference)
        noise = np.random.default_rng(i).gamma(0.2, 5, (height, width, 1))
        motion = np.full((height, width, 2), (2, 0), np.float32) * (i > 0)
        noisy = (light * noise).astype(np.float32)
        frames.append(dataclasses.replace(part, indirect=noisy, motion=motion))
    return Shot("made up", "room", "camera", "train", tuple(frames))


@dataclass(frozen=True)
class Method:
    """A way to denoise sequences. family: `ours`, `alone` for ours frame by frame, or `peer`."""

    name: str
    family: str
    run: Callable[[Sequence[Frame]], list[np.ndarray]]


def methods() -> list[Method]:
    """Frame by frame, and with a history; ours and others'."""
    alone = [
        Method(m, "alone", functools.partial(each, functools.partial(jflnr.denoise, method=m)))
        for m in ("flr", "flr-adaptive", "flnr")
    ]
    tuned = functools.partial(svgf.step, **svgf.TUNED_OVER_TIME)
    ours = [Method(f"{m}, temporal", "ours", with_history(m)) for m in SPATIAL]
    peers = [
        Method("BMFR", "peer", with_history("bmfr")),
        # TAA smooths the edges of textures, which the references have.
        Method("BMFR without TAA", "peer", with_history(BMFR(picture_share=1.0))),
        Method("SVGF", "peer", in_steps(svgf.start, svgf.step)),
        Method("SVGF, tuned", "peer", in_steps(svgf.start, tuned)),
    ]
    for denoise in oidn_peers():
        if denoise.name == "OIDN, tuned":
            peers.append(Method("OIDN", "peer", functools.partial(each, denoise)))
            peers.append(Method("OIDN of averages", "peer", of_averages(denoise)))
    return [*alone, *ours, *peers]


def each(denoise: Callable[[Frame], Array], frames: Sequence[Frame]) -> list[np.ndarray]:
    """Frame by frame, by a method that knows of no other frame."""
    return [np.asarray(denoise(frame)) for frame in frames]


def with_history(method: Any) -> Callable[[Sequence[Frame]], list[np.ndarray]]:
    """A method of jflnr, by name or as an object, over time."""

    def run(frames: Sequence[Frame]) -> list[np.ndarray]:
        denoiser = jflnr.Denoiser(method)
        return [np.asarray(denoiser.next(frame)) for frame in frames]

    return run


def of_averages(
    denoise: Callable[[Frame], Array],
) -> Callable[[Sequence[Frame]], list[np.ndarray]]:
    """Frame by frame, of the noisy light as a history of ours has averaged it."""

    def run(frames: Sequence[Frame]) -> list[np.ndarray]:
        state: Any = temporal.start(frames[0], "flr")
        lights = []
        for frame in frames:
            state, _ = temporal.step(state, frame, "flr")
            average = np.asarray(state.light.mean)
            lights.append(np.asarray(denoise(dataclasses.replace(frame, indirect=average))))
        return lights

    return run


def in_steps(
    start: Callable[[Frame], Any], step: Step
) -> Callable[[Sequence[Frame]], list[np.ndarray]]:
    """A method of a step function, from the first frame on."""

    def run(frames: Sequence[Frame]) -> list[np.ndarray]:
        state, lights = start(frames[0]), []
        for frame in frames:
            state, light = step(state, frame)
            lights.append(np.asarray(light))
        return lights

    return run
