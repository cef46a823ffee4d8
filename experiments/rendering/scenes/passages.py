"""Corridors and doorways, stairs, and big empty halls."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from experiments.rendering.scenes import furniture, palette
from experiments.rendering.scenes.furniture import placed
from experiments.rendering.scenes.geometry import box, cylinder, join, quad, rotation, sphere, tube
from experiments.rendering.scenes.shell import Opening, daylight, shell, sides, window
from experiments.rendering.scenes.world import Material, World, plain


def corridor(seed: int) -> World:
    """A corridor with doorways; the light comes from one end or out of the rooms beside it."""
    rng = np.random.default_rng([4, seed])
    width, height = rng.uniform(1.5, 3.0), rng.uniform(2.4, 3.4)
    length, room = rng.uniform(7, 14), rng.uniform(2.0, 3.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5), fov_x=(55.0, 85.0))
    wall, floor = palette.wall(rng), palette.floor(rng)
    size = (width, height, length)
    doors = [
        Opening(z - 0.5, z + 0.5, 0.0, 2.05)
        for z in np.arange(-length / 2 + 1.5, length / 2 - 1.0, rng.uniform(2.0, 3.2))
    ]
    end = Opening(-width * 0.35, width * 0.35, rng.uniform(0, 0.9), height - 0.3)
    walls = {"back": wall, "front": wall, "left": wall, "right": palette.wall(rng)}
    holes = {"right": doors, "back": [end] if rng.random() < 0.7 else []}
    shell(world, size, walls, holes, floor, plain(palette.pale(rng)), 0.2)
    strength = 10 ** rng.uniform(0, 1)
    if holes["back"]:
        back = sides(width, length)["back"]
        back.put(world, window(rng, end, 0.2))
        daylight(rng, world, back, end, strength)
    _side_rooms(rng, world, size, room, doors, strength)
    for z in np.arange(1.0, length - 1, 1.7):
        if rng.random() < 0.5:
            item = furniture.picture(rng, rng.uniform(0.4, 0.9), rng.uniform(0.4, 0.8))
            world.add_all(placed(item, [0.01, 1.6, z], 90))
        elif rng.random() < 0.5:
            world.add_all(placed(furniture.small_thing(rng, rng.uniform(0.3, 0.7)), [0.35, 0, z]))
    if rng.random() < 0.6:
        runner = furniture.carpet(rng, width * 0.5, length * 0.7)
        world.add_all(placed(runner, [width / 2, 0, length / 2]))
    _walk(rng, world, size)
    return world


def _side_rooms(
    rng: np.random.Generator,
    world: World,
    size: tuple[float, float, float],
    room: float,
    doors: list[Opening],
    strength: float,
) -> None:
    """Rooms behind the doors of the right wall, some with a lit wall or lamp."""
    width, height, length = size
    x = width + 0.2
    material, far = palette.wall(rng), x + room
    world.add(box([x, -0.2, -0.2], [far, 0, length + 0.2]), palette.floor(rng))
    world.add(box([x, height, -0.2], [far, height + 0.2, length + 0.2]), plain([0.7, 0.7, 0.7]))
    world.add(box([far, -0.2, -0.2], [far + 0.2, height + 0.2, length + 0.2]), material)
    edges = [
        -0.1,
        *(length / 2 + (a.right + b.left) / 2 for a, b in pairwise(doors)),
        length,
    ]
    for z in edges:
        world.add(box([x, 0, z - 0.05], [far, height, z + 0.05]), material)
    for low, high in pairwise(edges):
        if rng.random() < 0.5:
            z0 = low + (high - low) * 0.2
            panel = quad([far - 0.02, 0.9, z0], [0, 0, (high - low) * 0.6], [0, height - 1.4, 0])
            world.shine(panel, palette.lamplight(rng) * strength * rng.uniform(0.5, 2))
        if rng.random() < 0.6:
            item = furniture.cabinet(rng, 0.9, rng.uniform(0.6, 1.8))
            world.add_all(placed(item, [far - 0.05, 0, (low + high) / 2], -90))


def _walk(rng: np.random.Generator, world: World, size: tuple[float, float, float]) -> None:
    width, height, length = size
    for _ in range(16):
        world.lookouts.append(
            [
                width * rng.uniform(0.25, 0.75),
                rng.uniform(1.0, min(1.9, height - 0.3)),
                length * rng.uniform(0.35, 0.95),
            ]
        )
        world.sights.append(
            [width * rng.uniform(0.1, 1.2), rng.uniform(0.6, 1.5), length * rng.uniform(0, 0.5)]
        )


def stairs(seed: int) -> World:
    """A stairwell: two flights and a landing, a railing, a window high up."""
    rng = np.random.default_rng([6, seed])
    steps, rise, tread = int(rng.integers(8, 13)), rng.uniform(0.16, 0.19), rng.uniform(0.25, 0.3)
    flight, landing = rng.uniform(1.0, 1.6), rng.uniform(1.1, 1.6)
    width = 2 * flight + rng.uniform(0.1, 0.5)
    mid = steps * rise
    height, depth = 2 * mid + rng.uniform(2.2, 2.8), steps * tread + landing + rng.uniform(1.5, 3)
    world = World(ao_distance=rng.uniform(0.5, 1.2), fov_x=(60.0, 90.0))
    hole = Opening(-width * 0.3, width * 0.3, mid + rng.uniform(0.6, 1.0), height - 0.5)
    walls = dict.fromkeys(("back", "front", "left", "right"), palette.wall(rng))
    walls["right"] = palette.wall(rng)
    shell(
        world,
        (width, height, depth),
        walls,
        {"back": [hole]},
        palette.floor(rng),
        plain(palette.pale(rng)),
    )
    back = sides(width, depth)["back"]
    back.put(world, window(rng, hole, 0.25))
    strength = 10 ** rng.uniform(0, 1)
    daylight(rng, world, back, hole, strength)
    if rng.random() < 0.5:
        lamp = [width / 2, rng.uniform(1.9, 2.3), depth - 0.5]
        world.shine_ball(lamp, 0.12, palette.lamplight(rng) * strength * 8)
    material, rail = palette.timber(rng), palette.timber(rng)
    for i in range(steps):
        z = landing + (steps - i) * tread
        _step(world, (0, flight), i * rise, rise, z - tread, tread, material)
        z = landing + i * tread
        _step(world, (width - flight, width), mid + i * rise, rise, z, tread, material)
    world.add(box([0, mid - 0.18, 0], [width, mid, landing]), material)
    z0, z1 = landing + steps * tread, landing
    _railing(world, [flight - 0.05, 0, z0], [flight - 0.05, mid, z1], steps, rail)
    _railing(
        world, [width - flight + 0.05, mid, z1], [width - flight + 0.05, 2 * mid, z0], steps, rail
    )
    top = box([width - flight, 2 * mid - 0.18, z0], [width, 2 * mid, depth])
    world.add(top, material)
    for _ in range(16):
        low = rng.random() < 0.7
        y = rng.uniform(1.2, 2.4) if low else 2 * mid + rng.uniform(0.8, 1.5)
        x = rng.uniform(0.3, width - 0.3) if low else rng.uniform(width - flight, width - 0.3)
        world.lookouts.append([x, y, rng.uniform(z0 + 0.3, depth - 0.2)])
        world.sights.append(
            [rng.uniform(0.2, width), rng.uniform(0.4, 1.6 * mid), rng.uniform(0.5, z0)]
        )
    return world


def _step(
    world: World,
    x: tuple[float, float],
    y: float,
    rise: float,
    z: float,
    tread: float,
    material: Material,
) -> None:
    world.add(box([x[0], max(0.0, y - 0.12), z], [x[1], y + rise, z + tread + 0.02]), material)


def _railing(
    world: World, low: list[float], high: list[float], posts: int, material: Material
) -> None:
    a, b = np.asarray(low, float), np.asarray(high, float)
    up = np.array([0, 0.9, 0])
    bars = [tube([a + up, (a + b) / 2 + up, b + up], 0.03, 12)]
    for t in np.linspace(0, 1, posts + 1):
        bars.append(cylinder(0.012, 0.9, 8).moved(a + (b - a) * t))
    world.add(join(bars), material)


def hall(seed: int) -> World:
    """A big, nearly empty space: few things stand on the floor and touch it with their shadows."""
    rng = np.random.default_rng([7, seed])
    width, height, depth = rng.uniform(8, 16), rng.uniform(4, 8), rng.uniform(8, 18)
    world = World(ao_distance=rng.uniform(1.0, 3.0), fov_x=(50.0, 80.0))
    wall = palette.wall(rng)
    walls = dict.fromkeys(("front", "left", "right"), wall) | {"back": palette.wall(rng)}
    name = str(rng.choice(["back", "left", "right"]))
    side = sides(width, depth)[name]
    holes = [
        Opening(x - 0.9, x + 0.9, rng.uniform(0.5, 1.5), height - rng.uniform(0.5, 1.0))
        for x in np.linspace(-side.width / 2 + 1.5, side.width / 2 - 1.5, int(rng.integers(2, 4)))
    ]
    shell(
        world,
        (width, height, depth),
        walls,
        {name: holes},
        palette.floor(rng),
        plain(palette.pale(rng)),
    )
    strength = 10 ** rng.uniform(0, 1)
    for hole in holes:
        side.put(world, window(rng, hole, 0.25))
        daylight(rng, world, side, hole, strength)
    if rng.random() < 0.5:
        x, z, s = width / 2, depth / 2, rng.uniform(1.5, 3.0)
        panel = quad([x - s / 2, height - 0.02, z - s / 2], [s, 0, 0], [0, 0, s])
        world.shine(panel, palette.lamplight(rng) * strength)
    for _ in range(int(rng.integers(4, 12))):
        spot = np.array([rng.uniform(1, width - 1), 0, rng.uniform(1, depth - 1)])
        _lone_thing(rng, world, spot)
        world.sights.append(np.add(spot, [0, 0.4, 0]))
    for _ in range(20):
        world.lookouts.append(
            [rng.uniform(0.6, width - 0.6), rng.uniform(0.7, 2.2), rng.uniform(0.6, depth - 0.6)]
        )
    return world


def _lone_thing(rng: np.random.Generator, world: World, spot: np.ndarray) -> None:
    material, r = palette.fabric(rng), rng.uniform(0.25, 1.0)
    kind = int(rng.integers(5))
    if kind == 0:
        world.add(sphere(r).moved(np.add(spot, [0, r, 0])), material)
    elif kind == 1:
        block = box([-r, 0, -r * 0.7], [r, r * rng.uniform(0.4, 2.2), r * 0.7])
        world.add(block.turned(rotation(rng.uniform(0, 90))).moved(spot), material)
    elif kind == 2:
        world.add(cylinder(r * 0.5, r * rng.uniform(1, 3), 48).moved(spot), material)
    elif kind == 3:
        world.add_all(placed(furniture.chair(rng), spot, rng.uniform(0, 360)))
    else:
        world.add_all(placed([(furniture.vase(rng, 2 * r), material)], spot))
