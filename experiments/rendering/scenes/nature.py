"""Foliage of thousands of leaves, open terrain, and caves."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, palette, textures
from experiments.rendering.scenes.geometry import Array, Mesh, box, join, quad, sheet, sphere, tube
from experiments.rendering.scenes.sky import sky
from experiments.rendering.scenes.world import World, plain


def foliage(seed: int) -> World:
    """Bushes and trees in a garden: thousands of small quads before a wall, under the sky."""
    rng = np.random.default_rng([8, seed])
    world = World(ao_distance=rng.uniform(0.3, 1.2), fov_x=(45.0, 75.0))
    world.environment = sky(rng)
    world.add(_ground(rng, 9.0, 0.12, 60).moved([0, -0.05, 0]), _soil(rng, 2.0))
    if rng.random() < 0.8:
        high = rng.uniform(1.5, 3.5)
        world.add(box([-9, -0.5, -4.6], [9, high, -4.3]), palette.wall(rng))
    if rng.random() < 0.5:
        world.add(box([-5.0, -0.5, -9], [-4.7, 3, 9]), palette.wall(rng))
    spots = [
        np.array([rng.uniform(-3.5, 3.5), 0, rng.uniform(-3.8, 1.2)])
        for _ in range(int(rng.integers(5, 11)))
    ]
    for spot in spots:
        (_tree if rng.random() < 0.35 else _bush)(rng, world, spot)
        world.sights.append(np.add(spot, [0, rng.uniform(0.3, 1.6), 0]))
    for _ in range(int(rng.integers(2, 8))):
        r = rng.uniform(0.1, 0.4)
        stone = sphere(r, 24).moved([rng.uniform(-3, 3), r * 0.4, rng.uniform(-3, 2.5)])
        world.add(stone, plain(palette.stone(rng)))
    for _ in range(16):
        angle = rng.uniform(-1.1, 1.1)
        reach = rng.uniform(3.0, 6.0)
        world.lookouts.append(
            [reach * np.sin(angle), rng.uniform(0.5, 2.2), reach * np.cos(angle) - 1.0]
        )
    return world


def _soil(rng: np.random.Generator, size: float) -> palette.Material:
    colour = palette.leaf(rng) if rng.random() < 0.4 else palette.stone(rng) * 0.7
    return palette.textured(rng, textures.earth, colour, size)


def _bush(rng: np.random.Generator, world: World, spot: Array) -> None:
    count, tall = int(rng.integers(400, 1600)), rng.uniform(0.5, 1.6)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    centres = (
        direction * rng.uniform(0.5, 1, (count, 1)) ** 0.5 * [0.5 * tall, 0.5 * tall, 0.5 * tall]
    )
    centres = centres[centres[:, 1] > -0.5 * tall + 0.02] + spot + [0, tall * 0.5, 0]
    world.add(furniture.leaves(rng, centres, rng.uniform(0.03, 0.1)), plain(palette.leaf(rng)))
    if rng.random() < 0.4:
        blossom = centres[rng.random(len(centres)) < 0.06] + rng.normal(size=3) * 0.02
        if len(blossom):
            world.add(furniture.leaves(rng, blossom, 0.04), plain(palette.vivid(rng)))


def _tree(rng: np.random.Generator, world: World, spot: Array) -> None:
    tall = rng.uniform(2.2, 4.0)
    bark = palette.textured(rng, textures.earth, palette.wood(rng) * 0.7, 0.6)
    lean = rng.normal(size=3) * [0.25, 0, 0.25]
    heights = np.linspace(0, 1, 9)[:, None]
    trunk = spot + heights * [0, tall * 0.75, 0] + heights**2 * lean
    limbs = [tube(trunk, np.linspace(0.12, 0.05, 9), 12)]
    crowns = []
    for _ in range(int(rng.integers(5, 10))):
        start = trunk[int(rng.integers(4, 9))]
        reach = rng.normal(size=3) * [0.7, 0.25, 0.7] + [0, 0.35, 0]
        t = np.linspace(0, 1, 6)[:, None]
        limbs.append(tube(start + t * reach + t**2 * [0, 0.25, 0], np.linspace(0.04, 0.012, 6), 8))
        crowns.append(start + reach + rng.normal(size=(int(rng.integers(100, 320)), 3)) * 0.25)
    world.add(join(limbs), bark)
    leaves = furniture.leaves(rng, np.concatenate(crowns), rng.uniform(0.04, 0.1))
    world.add(leaves, plain(palette.leaf(rng)))


def _ground(rng: np.random.Generator, half: float, roughness: float, cells: int) -> Mesh:
    """A height field over (-half..half)^2, its front upwards."""
    x = np.linspace(-half, half, cells + 1)
    gx, gz = np.meshgrid(x, x)
    y = roughness * _hills(rng, gx, gz, half, 2.2)
    return sheet(np.stack([gx, y, gz], -1))


def _hills(rng: np.random.Generator, x: Array, z: Array, half: float, steep: float) -> Array:
    """A sum of 40 waves whose height falls with their frequency; deviation about 1."""
    y = np.zeros_like(x)
    total = 0.0
    for _ in range(40):
        frequency = 2 ** rng.uniform(0, 4.5)
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        height = frequency ** (-steep / 2)
        y += height * np.sin(
            frequency * np.pi / half * (x * np.cos(angle) + z * np.sin(angle)) + phase
        )
        total += height**2 / 2
    return y / np.sqrt(total)


def terrain(seed: int) -> World:
    """Rough rocky land under the sky: gullies, boulders, ledges."""
    rng = np.random.default_rng([9, seed])
    world = World(ao_distance=rng.uniform(0.5, 2.0), fov_x=(50.0, 80.0))
    world.environment = sky(rng)
    half, rough = 8.0, rng.uniform(0.5, 1.3)
    x = np.linspace(-half, half, 221)
    gx, gz = np.meshgrid(x, x)
    y = rough * _hills(rng, gx, gz, half, rng.uniform(1.6, 2.4))
    if rng.random() < 0.6:  # terraces
        step = rng.uniform(0.3, 0.7)
        y = step * (np.floor(y / step) + np.clip((y / step % 1 - 0.25) * 2, 0, 1))
    y += 0.35 * np.maximum(np.hypot(gx, gz) - 4.5, 0) ** 1.2
    world.add(sheet(np.stack([gx, y, gz], -1)), _soil(rng, rng.uniform(1, 4)))
    spot = np.array([0.0, 0.0, 0.0])
    for _ in range(int(rng.integers(10, 40))):
        i, j = rng.integers(30, 190, 2)
        spot = np.array([gx[i, j], y[i, j], gz[i, j]])
        world.add(_boulder(rng, rng.uniform(0.1, 0.6)).moved(spot), plain(palette.stone(rng)))
        world.sights.append(spot)
    for _ in range(24):
        i, j = rng.integers(40, 180, 2)
        world.lookouts.append([gx[i, j], y[i, j] + rng.uniform(0.4, 1.6), gz[i, j]])
    return world


def _boulder(rng: np.random.Generator, size: float) -> Mesh:
    ball = sphere(1.0, 32)
    p = ball.vertices.reshape(17, 33, 3)
    bumps = np.zeros(p.shape[:2])
    for _ in range(7):
        k = rng.normal(size=3) * rng.uniform(1.0, 4.0)
        bumps += np.sin(p @ k + rng.uniform(0, 6)) / np.linalg.norm(k)
    stretch = rng.uniform(0.6, 1.3, 3) * size
    return sheet(p * (1 + 0.25 * bumps[..., None]) * stretch)


def cave(seed: int) -> World:
    """A winding cave, lit by the sky at its mouth or by coloured lamps on the ground."""
    rng = np.random.default_rng([10, seed])
    world = World(ao_distance=rng.uniform(0.5, 1.5), fov_x=(60.0, 90.0))
    rows, columns, length = 160, 120, rng.uniform(9, 14)
    t = np.linspace(0, 1, rows)
    z = length * t
    bend = rng.uniform(0.8, 2.0) * np.sin(np.pi * t * rng.uniform(0.8, 1.6))
    bend -= bend[0]
    radius = rng.uniform(1.3, 2.0) * (1 + 0.35 * np.sin(2 * np.pi * t * rng.uniform(1, 2.5) + 1))
    angle = np.linspace(0, 2 * np.pi, columns)
    gz, ga = np.meshgrid(z, angle, indexing="ij")
    around = 3.0 * np.cos(ga), 3.0 * np.sin(ga)
    rough = np.zeros_like(gz)
    for _ in range(50):
        k = rng.normal(size=3) * 2 ** rng.uniform(-1, 2.2)
        wave = k[0] * around[0] + k[1] * around[1] + k[2] * gz + rng.uniform(0, 6)
        rough += np.sin(wave) / (1 + np.linalg.norm(k))
    r = radius[:, None] * (1 + 0.13 * rough)
    x = bend[:, None] + r * np.cos(ga) * 1.2
    y = np.maximum(r * np.sin(ga), -0.75 + 0.12 * rough)
    rock = sheet(np.stack([x, y, gz], -1))
    world.add(rock, palette.textured(rng, textures.earth, palette.stone(rng), rng.uniform(1, 3)))
    world.add(
        box([bend[-1] - 5, -4, length], [bend[-1] + 5, 5, length + 0.2]), plain([0.3, 0.28, 0.25])
    )
    strength = 10 ** rng.uniform(0, 1)
    sky_light = np.array([0.8, 0.95, 1.2]) if rng.random() < 0.6 else palette.lamplight(rng)
    mouth = quad([-3.2, -2.5, -0.6], [6.4, 0, 0], [0, 5.5, 0])
    world.shine(mouth, sky_light * strength)
    for _ in range(int(rng.integers(0, 3))):
        i = int(rng.integers(60, rows - 20))
        spot = [bend[i] + rng.uniform(-0.5, 0.5), -0.3, z[i]]
        world.shine_ball(spot, 0.14, palette.lamplight(rng) * strength * rng.uniform(3, 12))
    for _ in range(int(rng.integers(4, 12))):
        i = int(rng.integers(20, rows - 20))
        place = np.array([bend[i] + rng.uniform(-1, 1) * radius[i] * 0.8, -0.7, z[i]])
        world.add(_boulder(rng, rng.uniform(0.15, 0.45)).moved(place), plain(palette.stone(rng)))
        world.sights.append(place)
    for i in rng.integers(25, rows - 10, 20):
        world.lookouts.append([bend[i] + rng.uniform(-0.5, 0.5), rng.uniform(-0.2, 0.6), z[i]])
        world.sights.append([bend[int(i) // 2], rng.uniform(-0.3, 0.5), z[int(i) // 2]])
    return world
