"""Furnished rooms with windows, and close views of full shelves."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, interior, palette
from experiments.rendering.scenes.furniture import placed
from experiments.rendering.scenes.geometry import box
from experiments.rendering.scenes.shell import Opening, daylight, sides, window
from experiments.rendering.scenes.sky import sky
from experiments.rendering.scenes.world import World


def furnished(seed: int) -> World:
    """A living, dining or sleeping room, lit through one to three windows."""
    rng = np.random.default_rng([1, seed])
    size = interior.room_size(rng, 3.2, 6.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    openings = interior.windows(rng, size)
    interior.enclose(rng, world, size, openings)
    strength = 10 ** rng.uniform(0, 1.2)
    for name, holes in openings.items():
        side = sides(size[0], size[2])[name]
        for hole in holes:
            side.put(world, window(rng, hole, 0.25))
            daylight(rng, world, side, hole, strength)
            if rng.random() < 0.5:
                interior.hang_curtains(rng, world, side, hole, size[1])
    if rng.random() < 0.25:
        interior.ceiling_panel(rng, world, size, strength * rng.uniform(0.5, 3))
    interior.furnish(rng, world, size, set(openings))
    interior.look_around(rng, world, size)
    return world


def sunlit(seed: int) -> World:
    """A furnished room whose windows are open to a sky with a small sun: few samples find light."""
    rng = np.random.default_rng([12, seed])
    size = interior.room_size(rng, 3.2, 7.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    world.environment = sky(rng, rows=256, sun=(0.5, 1.5))
    openings = interior.windows(rng, size)
    interior.enclose(rng, world, size, openings)
    for name, holes in openings.items():
        side = sides(size[0], size[2])[name]
        for hole in holes:
            side.put(world, window(rng, hole, 0.25))
            if rng.random() < 0.4:
                interior.hang_curtains(rng, world, side, hole, size[1])
    world.add(box([-30, -0.5, -30], [30, -0.25, 30]), palette.floor(rng))
    interior.furnish(rng, world, size, set(openings))
    interior.look_around(rng, world, size)
    return world


def shelves(seed: int) -> World:
    """A wall of shelves with clutter, from near, lit by a window or a lamp of another colour."""
    rng = np.random.default_rng([3, seed])
    size = (rng.uniform(2.8, 4.5), rng.uniform(2.4, 3.0), rng.uniform(2.5, 4.0))
    world = World(ao_distance=rng.uniform(0.25, 0.8), fov_x=(45.0, 75.0))
    side_name = str(rng.choice(["left", "right"]))
    side = sides(size[0], size[2])[side_name]
    hole = Opening(-rng.uniform(0.4, 0.9), rng.uniform(0.4, 0.9), 0.8, rng.uniform(1.8, 2.3))
    interior.enclose(rng, world, size, {side_name: [hole]})
    side.put(world, window(rng, hole, 0.25))
    daylight(rng, world, side, hole, 10 ** rng.uniform(0, 1))
    if rng.random() < 0.4:
        spot = [rng.uniform(0.5, size[0] - 0.5), size[1] - 0.4, size[2] * 0.7]
        world.shine_ball(spot, 0.12, palette.lamplight(rng) * 10 ** rng.uniform(1.2, 2.2))
    x, top = 0.3, min(size[1] - 0.2, rng.uniform(1.6, 2.6))
    while x + 0.8 < size[0] - 0.2:
        width = rng.uniform(0.7, 1.4)
        width = min(width, size[0] - 0.25 - x)
        depth = rng.uniform(0.25, 0.4)
        world.add_all(placed(furniture.shelf(rng, width, top, depth), [x + width / 2, 0, 0.01]))
        for _ in range(2):
            world.sights.append([x + rng.random() * width, rng.uniform(0.4, top), 0.2])
        x += width + rng.choice([0.03, 0.25])
    world.add_all(
        placed(furniture.table(rng, 1.1, 0.6), [size[0] / 2, 0, 1.6], rng.uniform(-20, 20))
    )
    world.add_all(
        placed(
            furniture.clutter_row(rng, -0.45, 0.45, 0.74, 0.3, 0.35),
            [size[0] / 2, 0, 1.45],
            rng.uniform(-15, 15),
        )
    )
    world.lookouts = [
        [rng.uniform(0.4, size[0] - 0.4), rng.uniform(0.9, 1.9), rng.uniform(1.2, size[2] - 0.3)]
        for _ in range(12)
    ]
    return world
