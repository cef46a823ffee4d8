"""`render again FRAME -o FILE`: a finished frame once more, from what its header says of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.rendering import frame
from experiments.rendering.commands.one import STATES
from experiments.rendering.progress import Progress
from experiments.rendering.reference import Goal
from experiments.rendering.source import load
from experiments.rendering.tracer import Tracer
from jflnr import read_header
from jflnr.camera import Camera
from jflnr.exr import layers_of, read_channels

KEPT = ("scene", "view", "split")
NEEDED = {*KEPT, "camera_to_world", "reference_spp", "ao_distance"}
CHANGED = 0.005  # share of pixels at another depth that tells another scene


def run(arguments: argparse.Namespace) -> None:
    """Render the scene, view, noise and samples of `arguments.frame` into `arguments.output`.

    Raises ValueError for frames of sequences, and where the scene is no longer the same.
    """
    path, output = arguments.frame, arguments.output
    if output.exists():
        print(f"{output} is there already: kept")
        return
    facts, channels = read_header(path), read_channels(path)
    if not NEEDED <= facts.keys() or "depth.Z" not in channels:
        raise ValueError(f"{path} is not a frame of this renderer: its header names no scene")
    if "motion" in facts:
        raise ValueError(
            f"{path} is of a sequence: delete it and give the sequence's own command again"
        )
    settings = settings_of(facts, layers_of(channels), arguments.error, 60 * arguments.minutes)
    source = load(facts["scene"])
    camera = Camera(np.array(facts["camera_to_world"]), facts["fov_x_degrees"])
    tracer = Tracer.of(source.scene, camera, settings.width, settings.height)
    _check(path, tracer, channels["depth.Z"], facts)
    state, near = STATES / f"{output.stem}_again.npz", facts["ao_distance"]
    with Progress(output.name) as progress:
        layers, made = frame.render(source.scene, camera, settings, near, state, progress, tracer)
    frame.write(output, layers, {key: facts[key] for key in KEPT} | made)
    state.unlink(missing_ok=True)
    error = made["reference_median_relative_standard_error"]
    print(f"{output}: reference {made['reference_spp']} spp, error {error:.3f}")


def settings_of(
    facts: dict[str, Any], layers: dict[str, Any], error: float | None, seconds: float
) -> frame.Settings:
    """Those of a frame; of its reference as many samples, or such an `error`."""
    spp = facts["reference_spp"]
    noisy = [name.split("_")[1] for name in sorted(layers) if name.startswith("indirect_")]
    return frame.Settings(
        facts["width"],
        facts["height"],
        facts["seed"],
        tuple(sorted(int(n) for n in noisy)),
        facts["bounces"],
        "MIS" in facts["sampling"],
        facts["direct_spp"],
        goal=Goal(error, seconds=seconds) if error else Goal(0.0, spp, spp, float("inf")),
    )


def _check(path: Path, tracer: Tracer, depth: Any, facts: dict[str, Any]) -> None:
    off = np.abs(tracer.guides["depth"][..., 0] - depth) > 1e-3 * np.abs(depth)
    if off.mean() > CHANGED:
        raise ValueError(
            f"{path} cannot be rendered again: its scene {facts['scene']} has changed since "
            f"{facts['renderer']}"
        )
