"""From the name of a scene to what the renderer needs: one of ours, or any Mitsuba XML."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.rendering import views
from experiments.rendering.lambertian import load_xml
from experiments.rendering.sampling import stream_seed
from experiments.rendering.scene import build
from experiments.rendering.scenes.catalogue import world_of
from experiments.rendering.scenes.world import World
from experiments.rendering.splits import split_of
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera
from jflnr.exr import read_attributes

RANDOM = 100  # views from here on are random ones; those below are a scene's own


def shared_scenes() -> Path:
    """JFLNR_SCENES, else `shared/scenes` beside the repository."""
    default = Path(__file__).parents[3] / "shared" / "scenes"
    return Path(os.environ.get("JFLNR_SCENES", default))


def shared_frames() -> Path:
    """JFLNR_DATA, else `shared/data` beside the repository."""
    default = Path(__file__).parents[3] / "shared" / "data"
    return Path(os.environ.get("JFLNR_DATA", default))


@dataclass
class Source:
    """A loaded scene, its name, its near distance, and the cameras it brings."""

    name: str
    scene: Any
    ao_distance: float
    world: World | None
    own: dict[int, Camera]
    path: Path | None = None

    def view(self, number: int) -> tuple[Camera, float] | None:
        """Camera and ambient occlusion distance of a view; None where no valid view was found.

        Views below 100 are the scene's own: 0 the camera that it names, others those of the
        frames of `shared/data`. From 100 on they are random, each its own seed.
        """
        if number in self.own:
            return self.own[number], self.ao_distance
        rng = np.random.default_rng(stream_seed(self.name, "view", number))
        if self.world is not None:
            candidates = views.of_world(self.world, rng)
        else:
            candidates = views.of_scene(self.scene, self.own[0], rng)
        found = views.random_views(self.scene, candidates, self.ao_distance, 1)
        return (found[0], self.ao_distance) if found else None


def load(name: str) -> Source:
    """A scene by name (`room`, `stairs-3`, `living-room`) or by the path of its XML.

    Raises ValueError for a name that is neither.
    """
    path = Path(name)
    if path.suffix != ".xml":
        path = shared_scenes() / name / "scene.xml"
    if path.exists():
        return _load_xml(path, name)
    if name.endswith(".xml"):
        raise ValueError(f"there is no scene file {name}")
    world = world_of(name)
    own = views.camera_of(world)
    return Source(name, build(world), world.ao_distance, world, {0: own} if own else {})


def _load_xml(path: Path, name: str) -> Source:
    scene, home = load_xml(path)
    short = path.parent.name if path.name == "scene.xml" else path.stem
    own, distance = _stored_views(short)
    own.setdefault(0, home)
    return Source(short, scene, distance or _near(scene, home), None, own, path)


def _stored_views(name: str) -> tuple[dict[int, Camera], float | None]:
    """Cameras of the frames of `shared/data` of a scene, and their ambient occlusion distance."""
    found: dict[int, Camera] = {}
    distance = None
    for path in sorted((shared_frames() / split_of(name)).glob(f"{name}_[0-9].exr")):
        facts = json.loads(read_attributes(path).comments)
        matrix = np.array(facts["camera_to_world"], float)
        found[int(facts["view"])] = Camera(matrix, float(facts["fov_x_degrees"]))
        distance = float(facts["ao_distance"])
    return found, distance


def _near(scene: Any, home: Camera) -> float:
    """A quarter of the median distance that the scene's own camera sees."""
    depth = Tracer.of(scene, home, 64, 36).guides["depth"]
    if not (depth > 0).any():
        raise ValueError("the scene's own camera sees nothing; give it another one")
    return float(np.median(depth[depth > 0])) / 4
