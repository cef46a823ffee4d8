"""Smooth curved forms in a studio: knots, bent sheets, soft bodies, lit by large panels."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, palette
from experiments.rendering.scenes.geometry import (
    Array,
    Mesh,
    lathe,
    quad,
    rotation,
    sheet,
    sphere,
    tube,
)
from experiments.rendering.scenes.world import World, plain


def forms(seed: int) -> World:
    """A handful of curved forms on a rounded backdrop, under panels of several colours."""
    rng = np.random.default_rng([11, seed])
    world = World(ao_distance=rng.uniform(0.4, 1.2), fov_x=(40.0, 65.0))
    backdrop = palette.wall(rng) if rng.random() < 0.5 else plain(palette.any_colour(rng))
    world.add(_backdrop(), backdrop)
    for side in (-1, 1):
        if rng.random() < 0.7:
            wall = quad([4.0 * side, -0.1, -4 * side], [0, 0, 8.0 * side], [0, 4.5, 0])
            world.add(wall, palette.wall(rng))
    if rng.random() < 0.6:
        world.add(quad([-5, 4.4, -5], [10, 0, 0], [0, 0, 10]), plain(palette.pale(rng)))
    if rng.random() < 0.6:
        world.add(quad([5, -0.1, 5.0], [-10, 0, 0], [0, 4.5, 0]), palette.wall(rng))
    spots: list[Array] = []
    for _ in range(200):
        spot = np.array([rng.uniform(-2.2, 2.2), 0, rng.uniform(-1.8, 1.8)])
        if len(spots) < 8 and all(np.linalg.norm(spot - s) > 1.0 for s in spots):
            spots.append(spot)
    for spot in spots[: int(rng.integers(3, 9))]:
        size = rng.uniform(0.35, 0.6)
        mesh = FORMS[int(rng.integers(len(FORMS)))](rng).turned(np.eye(3) * size)
        low = mesh.vertices[:, 1].min()
        world.add(mesh.moved(spot - [0, low, 0]), palette.fabric(rng))
        world.sights.append(np.add(spot, [0, size, 0]))
    _panels(rng, world)
    for _ in range(16):
        angle, reach = rng.uniform(-1.0, 1.0), rng.uniform(2.6, 3.8)
        world.lookouts.append([reach * np.sin(angle), rng.uniform(0.4, 2.5), reach * np.cos(angle)])
    return world


def _backdrop() -> Mesh:
    """Floor and back wall joined by a curve."""
    angle = np.linspace(-np.pi / 2, 0, 16)
    curve = np.c_[-3.0 + 1.5 * -np.sin(angle + np.pi / 2), 1.5 + 1.5 * np.sin(angle)]
    profile = np.concatenate([[[5.0, 0.0]], curve, [[-4.5, 4.5]]])
    rows = np.stack([np.c_[np.full(18, x), profile[:, 1], profile[:, 0]] for x in (-5.0, 5.0)], 1)
    return sheet(rows).flipped()


def _panels(rng: np.random.Generator, world: World) -> None:
    strength = 10 ** rng.uniform(0, 1)
    for _ in range(int(rng.integers(1, 4))):
        w, h = rng.uniform(0.5, 2.2, 2)
        angle, height = rng.uniform(0, 360), rng.uniform(2.2, 3.8)
        panel = quad([-w / 2, -h / 2, 0], [w, 0, 0], [0, h, 0])
        panel = panel.turned(rotation(rng.uniform(35, 80), "x")).moved([0, 0, -2.5])
        world.shine(
            panel.turned(rotation(angle)).moved([0, height, 0]),
            palette.lamplight(rng) * strength * rng.uniform(0.5, 2),
        )
    if rng.random() < 0.3:
        world.shine_ball([rng.uniform(-2, 2), 3, 0], 0.2, palette.lamplight(rng) * strength * 20)


def _knot(rng: np.random.Generator) -> Mesh:
    p, q = ((2, 3), (3, 2), (2, 5), (3, 4))[int(rng.integers(4))]
    t = np.linspace(0, 2 * np.pi, 241)
    r = 0.62 + 0.26 * np.cos(q * t)
    path = np.stack([r * np.cos(p * t), 0.3 * np.sin(q * t), r * np.sin(p * t)], 1)
    return tube(path, rng.uniform(0.06, 0.11), 20).turned(rotation(rng.uniform(0, 90), "x"))


def _torus(rng: np.random.Generator) -> Mesh:
    t = np.linspace(0, 2 * np.pi, 97)
    ring = np.stack([0.7 * np.cos(t), np.zeros_like(t), 0.7 * np.sin(t)], 1)
    return tube(ring, rng.uniform(0.12, 0.3), 32).turned(rotation(rng.uniform(0, 90), "x"))


def _blob(rng: np.random.Generator) -> Mesh:
    p = sphere(1.0, 64).vertices.reshape(33, 65, 3)
    swell = sum(
        np.sin(p @ (rng.normal(size=3) * rng.uniform(1, 3)) + rng.uniform(0, 6)) for _ in range(4)
    )
    return sheet(p * (0.75 + 0.09 * np.asarray(swell)[..., None]))


def _turned(rng: np.random.Generator) -> Mesh:
    return furniture.vase(rng, 2.0)


def _ribbon(rng: np.random.Generator) -> Mesh:
    t = np.linspace(0, 1, 120)
    angle = 2 * np.pi * t * rng.uniform(0.8, 2.0)
    radius = 0.3 + 0.6 * t
    low = np.stack([radius * np.cos(angle), 0.15 * np.sin(3 * angle), radius * np.sin(angle)], 1)
    lean = np.stack([0.2 * np.sin(2 * angle), np.full(120, rng.uniform(0.5, 1.2)), 0 * t], 1)
    return sheet(np.stack([low + s * lean for s in np.linspace(0, 1, 8)]))


def _bowl(rng: np.random.Generator) -> Mesh:
    angle = np.linspace(0.05, np.pi / 2, 16)
    outer = [(np.sin(a), 0.7 * (1 - np.cos(a))) for a in angle]
    inner = [(0.9 * np.sin(a), 0.7 * (1 - np.cos(a) * 0.9)) for a in angle[::-1]]
    bowl = lathe([(0.0, 0.0), *outer, *inner, (0.0, inner[-1][1])], 64)
    return bowl.turned(rotation(rng.uniform(0, 40), "z"))


def _superellipsoid(rng: np.random.Generator) -> Mesh:
    width, height, depth = rng.uniform(0.8, 1.6, 3)
    return furniture.pillow(width, height, depth, rng.uniform(0.3, 1.8))


FORMS = (_knot, _torus, _blob, _turned, _ribbon, _bowl, _superellipsoid)
