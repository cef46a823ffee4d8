"""Shots: nothing, the camera, the light or an object moves; cameras and motion vectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.rendering import frame
from experiments.rendering.camera import looking
from experiments.rendering.lambertian import load_xml
from experiments.rendering.sampling import stream_seed
from experiments.rendering.scene import build
from experiments.rendering.scenes.geometry import Array, rotation, sphere
from experiments.rendering.scenes.textures import checks, limited
from experiments.rendering.scenes.world import Ball, Material, World
from experiments.rendering.source import Source
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera, centres

MOVER = "mover"
BALL = 0.06  # radius of the moving object, as a share of the distance that is looked at
LIGHT = ("light", "switch")


@dataclass(frozen=True)
class Shot:
    """A sequence that starts at a camera. motion: static, camera, light, switch or object.

    `switch` changes the light once, half-way. ahead: how far away what is looked at is.
    """

    source: Source
    start: Camera
    motion: str
    frames: int
    ahead: float

    @classmethod
    def of(cls, source: Source, start: Camera, motion: str, frames: int) -> Shot:
        """Raises ValueError where the scene cannot move in this way."""
        if motion in LIGHT and source.world is None:
            raise ValueError(
                f"a moving light needs a scene of ours, and {source.name} is a scene file: "
                "use --motion static, camera or object"
            )
        return cls(source, start, motion, frames, _ahead(source.scene, start))

    def time(self, number: int) -> float:
        """From 0 to 1."""
        if self.motion == "switch":
            return 0.5 * (2 * number >= self.frames)
        return number / max(self.frames - 1, 1)

    def camera(self, number: int) -> Camera:
        """The camera of a frame."""
        if self.motion != "camera":
            return self.start
        return along_path(self.start, self.ahead, self.time(number))

    def mover(self, number: int) -> Array | None:
        """Where the moving object is in a frame, (4, 4); None where there is none."""
        if self.motion != "object":
            return None
        return mover_matrix(self.start, self.ahead, self.time(number))

    def scene(self, number: int) -> Any:
        """The Mitsuba scene of a frame."""
        mover = self.mover(number)
        if mover is not None:
            return _with_mover(self.source, mover, BALL * self.ahead)
        if self.motion in LIGHT and self.source.world is not None:
            return build(with_light(self.source.world, self.time(number)))
        return self.source.scene

    def twin(self, number: int) -> int:
        """The first frame that differs from this one in nothing but its noise."""
        if self.motion == "switch":
            return 0 if 2 * number < self.frames else -(-self.frames // 2)
        return 0 if self.motion == "static" else number

    def motion_vectors(self, tracer: Tracer, number: int) -> NDArray[np.float64]:
        """Pixels `(H, W, 2)` from here to where each point was in the previous frame (x, y).

        Zero in the first frame. Where nothing is hit, the sky is taken to be far away.
        tracer: of this frame.
        """
        height, width = tracer.height, tracer.width
        if number == 0:
            return np.zeros((height, width, 2))
        here = centres(width, height)
        depth = tracer.guides["depth"][..., 0].astype(float)
        far = np.where(depth > 0, depth, 1e6)
        points = self.camera(number).points(here, far, width, height)
        now, before = self.mover(number), self.mover(number - 1)
        if now is not None and before is not None:
            on = tracer.shows(MOVER)
            back = before @ np.linalg.inv(now)
            points[on] = points[on] @ back[:3, :3].T + back[:3, 3]
        return self.camera(number - 1).project(points, width, height) - here


def render(
    shot: Shot,
    number: int,
    settings: frame.Settings,
    near: float,
    twin: Path,
    state: Path,
    report: Callable[[float, str], None] | None = None,
) -> tuple[frame.Layers, dict[str, Any]]:
    """Layers and facts of a frame of a shot, its noise and reference independent of the others'.

    But for twins: of what differs in nothing but its noise there is one reference, in the file
    `twin` of the first of them.
    """
    settings = replace(settings, seed=stream_seed(settings.seed, "frame", number))
    scene, camera = shot.scene(number), shot.camera(number)
    tracer = Tracer.of(scene, camera, settings.width, settings.height)
    if shot.twin(number) != number and twin.exists():
        layers, facts = frame.renoised(twin, tracer, settings)
    else:
        layers, facts = frame.render(scene, camera, settings, near, state, report, tracer)
    layers["motion"] = shot.motion_vectors(tracer, number)
    return layers, facts | {"motion": shot.motion, "frame": number}


def _ahead(scene: Any, camera: Camera) -> float:
    """Median depth of a view."""
    depth = Tracer.of(scene, camera, 64, 36).guides["depth"]
    return float(np.median(depth[depth > 0])) if (depth > 0).any() else 1.0


def along_path(camera: Camera, ahead: float, t: float) -> Camera:
    """A quarter of a slow turn about what the camera looks at, coming a little nearer."""
    left, up, forward, eye = camera.to_world[:3].T
    target = eye + ahead * forward
    side = 0.12 * ahead * np.sin(0.5 * np.pi * t)
    moved = eye + side * left + 0.08 * ahead * t * forward + 0.02 * ahead * np.sin(np.pi * t) * up
    return looking(moved, target, camera.fov_x, up)


def with_light(world: World, t: float) -> World:
    """The world with its round lamps moved on a circle, its sky turned and its panels dimmed."""
    swing = 0.35 * np.array([np.sin(2 * np.pi * t), 0.0, np.cos(2 * np.pi * t) - 1])
    x, _, z = swing
    balls = [
        Ball((b.centre[0] + x, b.centre[1], b.centre[2] + z), b.radius, b.radiance)
        for b in world.balls
    ]
    dim = 0.75 + 0.25 * np.cos(2 * np.pi * t)
    surfaces = [
        replace(s, radiance=tuple(dim * v for v in s.radiance)) if s.radiance else s
        for s in world.surfaces
    ]
    sky = world.environment
    if sky is not None:
        sky = np.roll(sky, round(t * sky.shape[1] / 8), axis=1)
    return replace(world, balls=balls, surfaces=surfaces, environment=sky)


def mover_matrix(camera: Camera, ahead: float, t: float) -> Array:
    """Where the rolling ball is: it crosses the view at 0.6 of what the camera looks at."""
    left, up, forward, eye = camera.to_world[:3].T
    reach = 0.25 * ahead * (1 - 2 * t)
    matrix = np.eye(4)
    matrix[:3, 3] = eye + 0.6 * ahead * forward + reach * left - 0.06 * ahead * up
    axes = np.stack([left, up, forward], 1)
    matrix[:3, :3] = axes @ rotation(np.degrees(reach / (BALL * ahead)), "z") @ axes.T
    return matrix


def _with_mover(source: Source, matrix: Array, radius: float) -> Any:
    if source.world is None:
        assert source.path is not None
        scene, _ = load_xml(source.path, (matrix, radius, MOVER))
        return scene
    ball = sphere(radius, 48).turned(matrix[:3, :3]).moved(matrix[:3, 3])
    look = limited(checks(np.random.default_rng(1), np.array([0.8, 0.3, 0.1])))
    world = replace(source.world, surfaces=list(source.world.surfaces))
    world.add(ball, Material(look, 2.5 * radius), MOVER)
    return build(world)
