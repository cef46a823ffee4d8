"""Colonnades: rows of columns and arches beside a court."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, palette, textures
from experiments.rendering.scenes.furniture import placed
from experiments.rendering.scenes.geometry import Mesh, box, join, lathe, sheet
from experiments.rendering.scenes.sky import sky
from experiments.rendering.scenes.world import Material, World, plain


def arched(width: float, height: float, spring: float, radius: float, thickness: float) -> Mesh:
    """A wall in x, y with a round arch: piers, the spandrels, and the arch's own surface."""
    angle = np.linspace(np.pi, 0, 25)
    arch = np.stack([radius * np.cos(angle), spring + radius * np.sin(angle)], 1)
    top = np.c_[arch[:, 0], np.full(25, height)]
    faces = []
    for z in (0.0, -thickness):
        low, high = (np.c_[p, np.full(25, z)] for p in (arch, top))
        front = sheet(np.stack([low, high]), smooth=False)
        faces.append(front.flipped() if z == 0 else front)
    soffit = sheet(np.stack([np.c_[arch, np.full(25, z)] for z in (-thickness, 0.0)]))
    for s in (-1, 1):
        x0, x1 = sorted((s * radius, s * width / 2))
        if x1 - x0 > 1e-6:
            faces.append(box([x0, 0, -thickness], [x1, height, 0]))
    return join([*faces, soffit])


def colonnade(seed: int) -> World:
    """Rows of columns and arches beside a court, under the sky or with light from one side."""
    rng = np.random.default_rng([5, seed])
    bays, pitch = int(rng.integers(4, 8)), rng.uniform(2.2, 3.4)
    height, depth = rng.uniform(3.6, 5.5), rng.uniform(2.5, 4.5)
    radius = pitch * rng.uniform(0.3, 0.42)
    spring = rng.uniform(0.5, 0.6) * height
    length = bays * pitch
    world = World(ao_distance=rng.uniform(1.0, 2.5), fov_x=(60.0, 90.0))
    stone = _masonry(rng)
    for i in range(bays):
        arch = arched(pitch, height, spring, radius, 0.4)
        world.add(arch.moved([(i + 0.5) * pitch, 0, 0]), stone)
        if rng.random() < 0.9:
            _column(rng, world, [i * pitch, 0, 0.5], spring, seed)
    world.add(box([-4, -0.2, -depth - 8], [length + 4, 0, 9]), _paving(rng))
    world.add(box([0, 0, -depth - 0.4], [length, height, -depth - 0.2]), palette.wall(rng))
    world.add(box([0, height, -depth - 0.4], [length, height + 0.3, 0.1]), stone)
    for x in (-0.3, length):
        world.add(box([x, 0, -depth - 0.4], [x + 0.3, height, 0.1]), stone)
    world.add(box([-4, 0, 8], [length + 4, rng.uniform(2, 6), 8.5]), palette.wall(rng))
    for _ in range(int(rng.integers(2, 7))):
        item = (
            furniture.plant(rng, rng.uniform(1, 2))
            if rng.random() < 0.5
            else (furniture.small_thing(rng, rng.uniform(0.4, 1.0)))
        )
        world.add_all(
            placed(item, [rng.uniform(0.5, length - 0.5), 0, rng.uniform(-depth + 0.5, 3)])
        )
    world.environment = sky(rng)
    for _ in range(16):
        inside = rng.random() < 0.65
        z = rng.uniform(-depth + 0.4, -0.8) if inside else rng.uniform(1.5, 6)
        world.lookouts.append([rng.uniform(0.4, length - 0.4), rng.uniform(1.2, 2.2), z])
        world.sights.append(
            [rng.uniform(0, length), rng.uniform(0.8, height * 0.6), rng.uniform(-depth, 0.3)]
        )
    return world


def _masonry(rng: np.random.Generator) -> Material:
    texture = (textures.bricks, textures.plaster, textures.marble)[int(rng.integers(3))]
    return palette.textured(rng, texture, palette.stone(rng), rng.uniform(1.2, 2.5))


def _paving(rng: np.random.Generator) -> Material:
    texture = (textures.tiles, textures.checks, textures.earth)[int(rng.integers(3))]
    return palette.textured(rng, texture, palette.stone(rng), rng.uniform(1.5, 3.0))


def _column(
    rng: np.random.Generator, world: World, foot: list[float], height: float, seed: int
) -> None:
    """A turned column; all of one scene are alike."""
    same = np.random.default_rng([50, seed])
    r, material = same.uniform(0.14, 0.24), plain(palette.stone(same))
    profile = [
        (r * 1.7, 0.0),
        (r * 1.7, 0.15),
        (r * 1.3, 0.18),
        (r * 1.1, 0.3),
        (r, height * 0.5),
        (r * 0.85, height - 0.4),
        (r * 1.2, height - 0.3),
        (r * 1.6, height - 0.12),
        (r * 1.6, height),
    ]
    world.add(lathe(profile, 32).moved(foot), material)
    x, _, z = foot
    top = box([x - r * 1.8, height, z - r * 1.8], [x + r * 1.8, height + 0.15, z + r * 1.8])
    world.add(top, material)
