"""What rooms are made of: walls with windows, furniture along them, places to look from."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from experiments.rendering.scenes import furniture, palette
from experiments.rendering.scenes.furniture import Items, placed
from experiments.rendering.scenes.geometry import box, quad
from experiments.rendering.scenes.shell import Opening, Side, shell, sides
from experiments.rendering.scenes.world import World, plain

Size = tuple[float, float, float]


def room_size(rng: np.random.Generator, low: float, high: float) -> Size:
    """Width, height and depth in metres; width and depth from `low` to `high`."""
    return rng.uniform(low, high), rng.uniform(2.4, 3.3), rng.uniform(low, high)


def windows(rng: np.random.Generator, size: Size) -> dict[str, list[Opening]]:
    names = rng.permutation(["back", "left", "right"])[: int(rng.choice([1, 2], p=[0.7, 0.3]))]
    widths = {"back": size[0], "left": size[2], "right": size[2]}
    low, high = rng.uniform(0.1, 1.0), rng.uniform(1.9, size[1] - 0.15)
    found = {}
    for name in map(str, names):
        count = int(rng.integers(1, 3))
        slots = np.linspace(-widths[name] / 2, widths[name] / 2, count + 1)
        found[name] = [
            Opening(
                a + (b - a) * rng.uniform(0.12, 0.3),
                b - (b - a) * rng.uniform(0.12, 0.3),
                low,
                high,
            )
            for a, b in pairwise(slots)
        ]
    return found


def enclose(
    rng: np.random.Generator, world: World, size: Size, openings: dict[str, list[Opening]]
) -> None:
    common = palette.wall(rng)
    walls = {name: common for name in ("back", "front", "left", "right")}
    if rng.random() < 0.6:
        walls[str(rng.choice(["back", "left", "right"]))] = palette.wall(rng)
    ceiling = plain(palette.linear([rng.uniform(0.75, 0.95)] * 3))
    shell(world, size, walls, openings, palette.floor(rng), ceiling)
    skirting = plain(palette.grey(rng)) if rng.random() < 0.5 else palette.timber(rng)
    for name, side in sides(size[0], size[2]).items():
        if not any(hole.low < 0.12 for hole in openings.get(name, [])):
            half = side.width / 2
            side.put(
                world, [(box([-half, 0, 0], [half, rng.uniform(0.07, 0.12), 0.015]), skirting)]
            )


def hang_curtains(
    rng: np.random.Generator, world: World, side: Side, hole: Opening, height: float
) -> None:
    items = furniture.curtain(rng, rng.uniform(0.3, 0.6), height - 0.15)
    for x in (hole.left - 0.1, hole.right + 0.1):
        side.put(world, placed(items, [x, 0.05, 0.14]))


def ceiling_panel(rng: np.random.Generator, world: World, size: Size, strength: float) -> None:
    w, d = rng.uniform(0.3, 1.2, 2)
    x, z = size[0] / 2 - w / 2, size[2] / 2 - d / 2
    panel = quad([x, size[1] - 0.03, z], [w, 0, 0], [0, 0, d])
    world.shine(panel, palette.lamplight(rng) * strength)
    world.add(
        box([x - 0.03, size[1] - 0.025, z - 0.03], [x + w + 0.03, size[1], z + d + 0.03]),
        plain([0.6, 0.6, 0.6]),
    )


def furnish(rng: np.random.Generator, world: World, size: Size, lit: set[str]) -> None:
    """Something large in the middle, cupboards and pictures along the walls, clutter on top."""
    width, height, depth = size
    middle = np.array([width * rng.uniform(0.4, 0.6), 0, depth * rng.uniform(0.4, 0.6)])
    turn = float(rng.choice([0, 90, 180, 270])) + rng.uniform(-12, 12)
    if rng.random() < 0.7:
        rug = furniture.carpet(rng, rng.uniform(1.5, width * 0.65), rng.uniform(1.2, depth * 0.6))
        world.add_all(placed(rug, middle, turn))
    kind = (_dining, _living, _sleeping)[int(rng.integers(3))]
    world.add_all(placed(kind(rng), middle, turn))
    world.sights += list(middle + np.array([[0, 0.6, 0], [0.4, 0.9, 0.3], [-0.4, 0.3, 0.2]]))
    for name, side in sides(width, depth).items():
        _along_wall(rng, world, side, height, name in lit)
    for x, z in ((0.4, 0.4), (width - 0.4, 0.4), (width - 0.4, depth - 0.4)):
        if rng.random() < 0.4:
            world.add_all(placed(furniture.plant(rng, rng.uniform(0.7, 1.9)), [x, 0, z]))


def _dining(rng: np.random.Generator) -> Items:
    width, depth = rng.uniform(1.0, 1.9), rng.uniform(0.8, 1.0)
    items = furniture.table(rng, width, depth)
    items += placed(
        furniture.clutter_row(rng, -width * 0.3, width * 0.3, 0.74, 0.25, 0.3), [0, 0, -0.15]
    )
    look = int(rng.integers(1 << 30))
    for x in np.linspace(-width / 2 + 0.3, width / 2 - 0.3, 2):
        for sign, turn in ((-1, 0), (1, 180)):
            if rng.random() < 0.85:
                chair = furniture.chair(np.random.default_rng(look))
                spot = [x, 0, sign * (depth / 2 + rng.uniform(0.05, 0.4))]
                items += placed(chair, spot, turn + rng.uniform(-20, 20))
    return items


def _living(rng: np.random.Generator) -> Items:
    items = placed(furniture.sofa(rng, rng.uniform(1.4, 2.2)), [0, 0, -0.9])
    items += placed(furniture.table(rng, 1.0, 0.6, 0.42), [0, 0, 0.2])
    thing = furniture.small_thing(rng, rng.uniform(0.15, 0.3))
    items += placed(thing, [rng.uniform(-0.3, 0.3), 0.42, 0.2])
    if rng.random() < 0.6:
        items += placed(furniture.sofa(rng, 0.8), [1.2, 0, 0.3], -90 + rng.uniform(-20, 20))
    return items


def _sleeping(rng: np.random.Generator) -> Items:
    items = furniture.bed(rng, rng.uniform(1.0, 1.8))
    items += placed(furniture.cabinet(rng, 0.45, 0.5), [1.25, 0, -1.0])
    items += placed(furniture.small_thing(rng, 0.25), [1.25, 0.5, -0.8])
    return items


def _along_wall(
    rng: np.random.Generator, world: World, side: Side, height: float, has_window: bool
) -> None:
    x = -side.width / 2 + 0.6
    while x < side.width / 2 - 0.9:
        width = rng.uniform(0.6, 1.3)
        choice = rng.random()
        spot = [x + width / 2, 0, 0.02]
        if not has_window and choice < 0.3:
            side.put(world, placed(furniture.shelf(rng, width, rng.uniform(0.8, 2.1)), spot))
        elif not has_window and choice < 0.55:
            tall = rng.uniform(0.5, 2.0)
            side.put(world, placed(furniture.cabinet(rng, width, tall), spot))
            if tall < 1.3:
                row = furniture.clutter_row(rng, -width / 2, width / 2, tall, 0.3, 0.3)
                side.put(world, placed(row, spot))
        elif not has_window and choice < 0.8:
            framed = furniture.picture(rng, width * 0.8, rng.uniform(0.4, 0.9))
            side.put(world, placed(framed, [spot[0], min(1.6, height - 0.7), 0.01]))
        elif choice > 0.9:
            box_item = furniture.small_thing(rng, rng.uniform(0.3, 0.6))
            side.put(world, placed(box_item, [spot[0], 0, 0.45]))
        if rng.random() < 0.5:
            world.sights.append(side.point([spot[0], rng.uniform(0.5, 1.6), 0.2]))
        x += width + rng.uniform(0.1, 0.9)


def look_around(rng: np.random.Generator, world: World, size: Size) -> None:
    """Lookouts at eye height, mostly near the walls."""
    for _ in range(24):
        x, z = (
            rng.choice([rng.uniform(0.3, 1.0), s - rng.uniform(0.3, 1.0), s * rng.random()])
            for s in (size[0], size[2])
        )
        world.lookouts.append([x, rng.uniform(0.9, min(1.9, size[1] - 0.4)), z])
