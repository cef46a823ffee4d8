"""Sequences: a camera path, a moving light, or a moving object; cameras and motion vectors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.render.camera import Camera
from experiments.render.lambertian import load_xml
from experiments.render.scene import build
from experiments.render.source import Source
from experiments.render.tracer import Tracer
from experiments.scenes.geometry import Array, rotation, sphere
from experiments.scenes.textures import checks, limited
from experiments.scenes.world import Ball, Material, World

MOVER = "mover"
BALL = 0.06  # radius of the moving object, as a share of the distance that is looked at


@dataclass(frozen=True)
class Step:
    """One frame of a sequence: scene, camera, and the mover's matrix (4, 4) where there is one."""

    scene: Any
    camera: Camera
    mover: Array | None = None


def steps(source: Source, camera: Camera, motion: str, frames: int) -> Iterator[Step]:
    """The frames of a sequence that starts at `camera`.

    Raises ValueError where the scene cannot move in this way.
    """
    if motion == "light" and source.world is None:
        raise ValueError(
            f"a moving light needs a scene of ours, and {source.name} is a scene file: "
            "use --motion camera or --motion object"
        )
    ahead = _ahead(source.scene, camera)
    for number in range(frames):
        t = number / max(frames - 1, 1)
        if motion == "camera":
            yield Step(source.scene, along_path(camera, ahead, t))
        elif motion == "light":
            assert source.world is not None
            yield Step(build(with_light(source.world, t)), camera)
        else:
            matrix = mover_matrix(camera, ahead, t)
            yield Step(_with_mover(source, matrix, BALL * ahead), camera, matrix)


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
    return Camera.looking(moved, target, camera.fov_x, up)


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


def motion_vectors(tracer: Tracer, step: Step, before: Step | None) -> NDArray[np.float64]:
    """Pixels `(H, W, 2)` from here to where each point was in the previous frame (x, y).

    Zero in the first frame. Where nothing is hit, the sky is taken to be far away.
    """
    height, width = tracer.height, tracer.width
    if before is None:
        return np.zeros((height, width, 2))
    y, x = np.mgrid[:height, :width] + 0.5
    here = np.stack([x, y], -1)
    depth = tracer.guides["depth"][..., 0].astype(float)
    points = step.camera.points(here, np.where(depth > 0, depth, 1e6), width, height)
    if step.mover is not None and before.mover is not None:
        on = tracer.shows(MOVER)
        back = before.mover @ np.linalg.inv(step.mover)
        points[on] = points[on] @ back[:3, :3].T + back[:3, 3]
    return before.camera.project(points, width, height) - here
