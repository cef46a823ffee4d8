"""The small room whose picture ships with the package: window light, a table, a sphere."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, palette, textures
from experiments.rendering.scenes.geometry import box, quad, rotation, sphere
from experiments.rendering.scenes.shell import Opening, shell, sides, window
from experiments.rendering.scenes.world import Glimpse, Material, World, plain


def room() -> World:
    """Always the same scene."""
    rng = np.random.default_rng(21)
    world = World(ao_distance=1.0)
    size = (4.4, 2.7, 4.8)
    white = plain([0.78, 0.76, 0.72])
    walls = {
        "back": Material(textures.limited(textures.bricks(rng, np.array([0.55, 0.3, 0.22]))), 1.1),
        "front": white,
        "left": plain([0.24, 0.42, 0.43]),
        "right": plain([0.62, 0.6, 0.52]),
    }
    openings = [Opening(-0.2, 1.5, 0.85, 2.25)]
    wood = palette.textured(rng, textures.planks, np.array([0.42, 0.24, 0.12]), 1.6)
    shell(world, size, walls, {"left": openings}, wood, white)
    left = sides(size[0], size[2])["left"]
    left.put(world, window(rng, openings[0], 0.25))
    _sky(world)
    _furnish(world, rng)
    world.view = Glimpse((3.35, 1.55, 4.5), (1.75, 0.85, 1.0), 70.0)
    world.lookouts = [world.view.origin]
    return world


def _sky(world: World) -> None:
    """A sky panel before the window and a low sun above it."""
    world.shine(quad([-0.7, 0.55, 2.8], [0, 0, -2.9], [0, 2.0, 0]), [3.2, 3.9, 5.0])
    world.shine_ball([-1.6, 4.0, 2.3], 0.16, np.array([1.0, 0.8, 0.58]) * 900)


def _furnish(world: World, rng: np.random.Generator) -> None:
    put = furniture.placed
    table = put(furniture.table(np.random.default_rng(5), 1.3, 0.8), [2.0, 0, 1.6], 8)
    world.add_all(table)
    world.add(sphere(0.2, 64).moved([2.25, 0.94, 1.65]), plain([0.75, 0.72, 0.66]))
    vase = furniture.vase(np.random.default_rng(3), 0.42).moved([1.7, 0.74, 1.5])
    world.add(vase, plain([0.08, 0.2, 0.55]))
    world.add(box([1.95, 0.74, 1.85], [2.2, 0.79, 2.02]).moved([0, 0, 0]), plain([0.6, 0.08, 0.06]))
    world.add_all(put(furniture.chair(np.random.default_rng(11)), [2.55, 0, 2.45], 195))
    weave = palette.textured(
        np.random.default_rng(3), textures.rug, np.array([0.4, 0.12, 0.08]), 2.4
    )
    rug = quad([-1.2, 0.012, 0.85], [2.4, 0, 0], [0, 0, -1.7]).turned(rotation(6))
    world.add(rug.moved([2.0, 0, 2.2]), weave)
    world.add_all(put(furniture.shelf(np.random.default_rng(4), 1.1, 1.9), [3.75, 0, 0.0]))
    world.add_all(put(furniture.picture(np.random.default_rng(9), 0.9, 0.6), [1.7, 1.65, 0.0]))
    world.add_all(put(furniture.plant(np.random.default_rng(6), 1.3), [0.55, 0, 0.55]))
    cube = box([-0.2, 0, -0.2], [0.2, 0.4, 0.2]).turned(rotation(25))
    world.add(cube.moved([0.9, 0, 2.9]), plain([0.75, 0.5, 0.08]))
