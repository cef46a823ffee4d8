"""`render SCENE`: one view into a file, several views or a sequence into a folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.rendering import frame, sequence
from experiments.rendering.manifest import Manifest
from experiments.rendering.progress import Progress
from experiments.rendering.reference import Goal
from experiments.rendering.sequence import Shot
from experiments.rendering.source import RANDOM, Source, load
from experiments.rendering.splits import split_of
from jflnr.camera import Camera

STATES = Path("cache/state")


def run(arguments: argparse.Namespace) -> None:
    """Render what is not there yet; finished frames are kept."""
    source = load(arguments.scene)
    settings = settings_of(arguments)
    if arguments.views:
        numbers = range(RANDOM, RANDOM + arguments.views)
        for number in numbers:
            number += 1000 * arguments.seed
            path = arguments.output / f"{source.name}_{number}.exr"
            _view(source, number, path, settings, arguments)
    elif arguments.motion:
        _sequence(source, settings, arguments)
    else:
        number = arguments.view
        if number is None:
            number = 0 if 0 in source.own else RANDOM
        _view(source, number, arguments.output, settings, arguments)


def settings_of(arguments: argparse.Namespace) -> frame.Settings:
    """What the arguments ask for. Raises ValueError for what cannot be."""
    for name in ("width", "height", "realisations", "bounces", "frames", "direct_spp"):
        if getattr(arguments, name) < 1:
            raise ValueError(f"--{name.replace('_', '-')} must be at least 1")
    if not 0 < arguments.error or not 0 < arguments.minutes:
        raise ValueError("--error and --minutes must be positive")
    if any(n < 1 for n in arguments.spp):
        raise ValueError("--spp takes sample counts of at least 1")
    goal = Goal(arguments.error, seconds=60 * arguments.minutes)
    if arguments.reference_spp:
        count = arguments.reference_spp
        goal = Goal(0.0, count, count, float("inf"))
    return frame.Settings(
        arguments.width,
        arguments.height,
        arguments.seed,
        (*arguments.spp, *(1,) * (arguments.realisations - 1)),
        arguments.bounces,
        not arguments.nee_only,
        arguments.direct_spp,
        goal=goal,
    )


def _view(
    source: Source, number: int, path: Path, settings: frame.Settings, arguments: Any
) -> None:
    if path.exists():
        print(f"{path} is there already: kept")
        return
    camera, near = _found(source, number, arguments)
    state = _state(path, settings)
    with Progress(path.name) as progress:
        layers, facts = frame.render(source.scene, camera, settings, near, state, progress)
    _write(source, layers, {"view": number} | facts, path, state, arguments)


def _sequence(source: Source, settings: frame.Settings, arguments: Any) -> None:
    number = arguments.view if arguments.view is not None else (0 if source.own else RANDOM)
    camera, near = _found(source, number, arguments)
    shot = Shot.of(source, camera, arguments.motion, arguments.frames)
    name = f"{source.name}_{arguments.motion}"
    paths = [arguments.output / f"{name}_{i:03}.exr" for i in range(arguments.frames)]
    for i, path in enumerate(paths):
        if path.exists():
            print(f"{path} is there already: kept")
            continue
        state = _state(path, settings)
        with Progress(path.name) as progress:
            twin = paths[shot.twin(i)]
            layers, facts = sequence.render(shot, i, settings, near, twin, state, progress)
        _write(source, layers, {"view": number} | facts, path, state, arguments)


def _found(source: Source, number: int, arguments: Any) -> tuple[Camera, float]:
    """The camera of a view, and its ambient occlusion distance."""
    found = source.view(number)
    if found is None:
        raise ValueError(f"no valid view {number} of {source.name} was found: try another --seed")
    return found[0], arguments.ao_distance or found[1]


def _state(path: Path, settings: frame.Settings) -> Path:
    return STATES / f"{path.stem}_{settings.width}x{settings.height}.npz"


def _write(
    source: Source,
    layers: frame.Layers,
    facts: dict[str, Any],
    path: Path,
    state: Path,
    arguments: Any,
) -> None:
    facts = {"scene": source.name, "split": split_of(source.name)} | facts
    frame.write(path, layers, facts, tuple(arguments.leave_out))
    state.unlink(missing_ok=True)
    if path != arguments.output:  # a folder of frames has a manifest, a single frame its header
        entry = {k: v for k, v in facts.items() if k != "camera_to_world"}
        Manifest(path.parent).add(path.name, entry)
    _say(path, facts)


def _say(path: Path, facts: dict[str, Any]) -> None:
    error = facts["reference_median_relative_standard_error"]
    speed = facts["reference_samples_per_processor_second"] / 1e6
    spp = facts["reference_spp"]
    print(f"{path}: reference {spp} spp, error {error:.3f}, {speed:.2f} million samples/core-s")
