"""Random views that are worth rendering: inside, not against a wall, lit, with something to see."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.rendering.camera import looking
from experiments.rendering.scenes.world import World
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera

TRIES = 60
CHOICE = 3  # of so many valid views, the one with most to see is taken
PROBE = (64, 36)


def camera_of(world: World) -> Camera | None:
    """The view that a world names for itself."""
    view = world.view
    return looking(view.origin, view.target, view.fov_x) if view else None


def random_views(
    scene: Any, candidates: Iterator[Camera], scale: float, count: int
) -> list[Camera]:
    """`count` valid views out of the candidates; fewer where a scene has no more to offer.

    `scale` is the scene's ambient occlusion distance: the length of what is near in it.
    """
    found: list[Camera] = []
    while len(found) < count:
        valid: list[tuple[float, Camera]] = []
        for _, camera in zip(range(TRIES), candidates, strict=False):
            worth = interest(scene, camera, scale)
            if worth is not None:
                valid.append((worth, camera))
            if len(valid) == CHOICE:
                break
        if not valid:
            break
        found.append(max(valid, key=lambda v: v[0])[1])
    return found


def of_world(world: World, rng: np.random.Generator) -> Iterator[Camera]:
    """From a lookout to a sight, both moved a little."""
    while True:
        eye = np.asarray(world.lookouts[int(rng.integers(len(world.lookouts)))], float)
        target = np.asarray(world.sights[int(rng.integers(len(world.sights)))], float)
        eye = eye + rng.normal(size=3) * 0.1
        target = target + rng.normal(size=3) * 0.15
        away = target - eye
        if np.linalg.norm(away) > 0.5 and np.hypot(away[0], away[2]) > 0.35 * np.linalg.norm(away):
            yield looking(eye, target, rng.uniform(*world.fov_x))


def of_scene(scene: Any, home: Camera, rng: np.random.Generator) -> Iterator[Camera]:
    """Views of any scene: from points seen from its own camera, to other points seen from there.

    What the camera sees is reachable, so a point part of the way to it lies inside.
    """
    up = _upright(home)
    places = [home]
    while True:
        start = places[int(rng.integers(len(places)))]
        probe = Tracer.of(scene, start, *PROBE)
        seen = probe.guides["position"][probe.guides["depth"][..., 0] > 0]
        if len(seen) < 100:
            continue
        goal, target = seen[rng.integers(len(seen), size=2)].astype(float)
        eye = start.to_world[:3, 3]
        eye = eye + rng.uniform(0, 0.6) * (goal - eye) * (1 - 0.8 * np.abs(up))
        if abs(np.dot(target - eye, up)) < 0.5 * np.linalg.norm(target - eye):
            camera = looking(eye, target, home.fov_x * rng.uniform(0.8, 1.05), up)
            if len(places) < 8:
                places.append(camera)
            yield camera


def _upright(camera: Camera) -> NDArray[np.float64]:
    """The world axis nearest to the camera's own up."""
    up = camera.to_world[:3, 1]
    axis = int(np.argmax(np.abs(up)))
    return np.sign(up[axis]) * np.eye(3)[axis]


def interest(scene: Any, camera: Camera, scale: float) -> float | None:
    """How much there is to see, from the spread of normals, colours and depths; None if invalid."""
    probe = Tracer.of(scene, camera, *PROBE)
    mask = probe.guides["mask"][..., 0] > 0
    depth = probe.guides["depth"][..., 0][mask]
    if mask.mean() < 0.5:
        return None
    if np.quantile(depth, 0.05) < 0.25 * scale or np.median(depth) < 1.0 * scale:
        return None
    light = _blocks(probe.indirect(64, 1, 0).mean(-1) * mask) / 64
    weight = _blocks(mask.astype(float))
    light = light[weight > 0.25] / weight[weight > 0.25]
    if light.mean() <= 0 or (light < 0.03 * light.mean()).mean() > 0.15:
        return None
    normals = probe.guides["normal"][mask].std(0).sum()
    colours = np.log(probe.guides["albedo"][mask] + 0.02).std(0).mean()
    steps = np.abs(np.diff(np.log(np.maximum(probe.guides["depth"][..., 0], 1e-3)), axis=1)) > 0.1
    score = float(normals + colours + 8 * min(steps.mean(), 0.15))
    return score if normals > 0.5 else None


def _blocks(picture: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Means over 4 x 4 pixels."""
    h, w = picture.shape
    return picture.reshape(h // 4, 4, w // 4, 4).mean((1, 3))
