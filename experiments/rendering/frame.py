"""Renders one frame: every layer of docs/scenes.md, and what its header says."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering.reference import Accumulator, Goal
from experiments.rendering.sampling import stream_seed
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera
from jflnr.exr import layers_of, read_attributes, read_channels, write_channels

AXES = {
    "normal": "XYZ", "seen_normal": "XYZ", "position": "XYZ", "depth": "Z",
    "ao": "Y", "mask": "Y", "alpha": "A", "motion": "XY",
}  # fmt: skip
NUMBER = re.compile(r"_\d+(_[a-z])?$")
SINGLE = ("depth",)  # in float; every other layer in half
RENDERER = 4  # counts the changes that alter the frames

Layers = dict[str, NDArray[np.floating[Any]]]


@dataclass(frozen=True)
class Settings:
    """What a frame holds. `noisy` are the sample counts, repeated for more realisations."""

    width: int = 640
    height: int = 360
    seed: int = 0
    noisy: tuple[int, ...] = (1,)
    bounces: int = 1
    mis: bool = True
    direct_spp: int = 128
    ao_rays: int = 64
    goal: Goal = field(default_factory=Goal)


def noisy_names(settings: Settings) -> dict[str, int]:
    """Names of the noisy layers and their sample counts: indirect_1, indirect_1_b, indirect_2..."""
    names: dict[str, int] = {}
    for index, spp in enumerate(settings.noisy):
        before = settings.noisy[:index].count(spp)
        names[f"indirect_{spp}" + (f"_{ascii_lowercase[before]}" if before else "")] = spp
    return names


def render(
    scene: Any,
    camera: Camera,
    settings: Settings,
    ao_distance: float,
    state: Path | None = None,
    report: Callable[[float, str], None] | None = None,
    tracer: Tracer | None = None,
) -> tuple[Layers, dict[str, Any]]:
    """The layers of one view, each `(H, W, C)`, and the facts of its header.

    The reference resumes from the file `state`, where that is given and exists. `report` hears
    the share done and the standard error. `tracer` may hold the primary hits already.
    """
    tracer = tracer or Tracer.of(scene, camera, settings.width, settings.height)

    def seed(layer: str) -> int:
        return stream_seed(settings.seed, layer)

    layers: Layers = dict(tracer.guides)
    layers["ao"] = tracer.occlusion(settings.ao_rays, ao_distance, seed("ao"))
    mask = layers["mask"] > 0
    layers["direct"] = mask * tracer.direct(settings.direct_spp, seed("direct"))
    layers["direct"] /= settings.direct_spp
    reference = Accumulator.of(tracer, settings, seed("reference"), mask[..., 0], state)
    reference.run(settings.goal, report)
    layers["reference"], layers["reference_a"] = reference.mean(), reference.first_half()
    layers |= noisy(tracer, settings)
    facts = {
        "reference_spp": reference.spp,
        "reference_processor_seconds": round(reference.seconds, 1),
        "reference_median_relative_standard_error": round(reference.relative_error(), 5),
        "reference_sampling": "guided next-event estimation" + (" + MIS" if reference.mis else ""),
        "reference_samples_per_processor_second": round(reference.samples_per_second()),
    }
    return layers, header(camera, settings, ao_distance) | facts


def noisy(tracer: Tracer, settings: Settings) -> Layers:
    """The noisy layers, each from a stream of its own."""
    mask = tracer.guides["mask"] > 0
    layers: Layers = {}
    for name, spp in noisy_names(settings).items():
        seed = stream_seed(settings.seed, name)
        layers[name] = mask * tracer.indirect(spp, seed, None, settings.bounces, settings.mis) / spp
    return layers


def renoised(path: Path, tracer: Tracer, settings: Settings) -> tuple[Layers, dict[str, Any]]:
    """The finished frame `path` with other noise."""
    layers, facts = read(path)
    return layers | noisy(tracer, settings), facts | {"seed": settings.seed}


def read(path: Path) -> tuple[Layers, dict[str, Any]]:
    """The layers of a finished frame, and the facts of its header."""
    channels = read_channels(path)
    layers = {
        name: np.stack([channels[f"{name}.{axis}"] for axis in axes], -1)
        for name, axes in layers_of(channels).items()
    }
    return layers, json.loads(read_attributes(path).comments)


def header(camera: Camera, settings: Settings, ao_distance: float) -> dict[str, Any]:
    """What the EXR's header says of a frame, but for its scene and its reference."""
    return {
        "width": settings.width,
        "height": settings.height,
        "seed": settings.seed,
        "bounces": settings.bounces,
        "direct_spp": settings.direct_spp,
        "ao_distance": float(ao_distance),
        "camera_to_world": camera.to_world.tolist(),
        "fov_x_degrees": camera.fov_x,
        "sampling": "next-event estimation" + (" + MIS" if settings.mis else " only"),
        "renderer": f"mitsuba {mi.__version__}, jflnr renderer {RENDERER}",
    }


def write(
    path: Path, layers: Layers, facts: dict[str, Any], leave_out: tuple[str, ...] = ()
) -> None:
    """Write a frame as EXR, atomically: depth in float, the rest in half."""
    largest = float(np.finfo(np.float16).max)
    channels = {}
    for name, picture in layers.items():
        if name in leave_out:
            continue
        kind = np.float32 if name in SINGLE else np.float16
        for i, axis in enumerate(AXES.get(NUMBER.sub("", name), "RGB")):
            channels[f"{name}.{axis}"] = np.clip(picture[..., i], -largest, largest).astype(kind)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_channels(path, channels, json.dumps(facts))
