"""Furnished rooms with windows, rooms lit by shaded lamps, and close views of full shelves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from experiments.scenes import furniture, palette
from experiments.scenes.furniture import Items, placed
from experiments.scenes.geometry import box, cylinder, lathe, quad, rotation, tube
from experiments.scenes.shell import Opening, Side, daylight, shell, sides, window
from experiments.scenes.sky import sky
from experiments.scenes.world import World, plain

Size = tuple[float, float, float]


def furnished(seed: int) -> World:
    """A living, dining or sleeping room, lit through one to three windows."""
    rng = np.random.default_rng([1, seed])
    size = _size(rng, 3.2, 6.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    openings = _windows(rng, size)
    _enclose(rng, world, size, openings)
    strength = 10 ** rng.uniform(0, 1.2)
    for name, holes in openings.items():
        side = sides(size[0], size[2])[name]
        for hole in holes:
            side.put(world, window(rng, hole, 0.25))
            daylight(rng, world, side, hole, strength)
            if rng.random() < 0.5:
                _hang_curtains(rng, world, side, hole, size[1])
    if rng.random() < 0.25:
        _ceiling_panel(rng, world, size, strength * rng.uniform(0.5, 3))
    _furnish(rng, world, size, set(openings))
    _look_around(rng, world, size)
    return world


def sunlit(seed: int) -> World:
    """A furnished room whose windows are open to a sky with a small sun: few samples find light."""
    rng = np.random.default_rng([12, seed])
    size = _size(rng, 3.2, 7.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    world.environment = sky(rng, rows=256, sun=(0.5, 1.5))
    openings = _windows(rng, size)
    _enclose(rng, world, size, openings)
    for name, holes in openings.items():
        side = sides(size[0], size[2])[name]
        for hole in holes:
            side.put(world, window(rng, hole, 0.25))
            if rng.random() < 0.4:
                _hang_curtains(rng, world, side, hole, size[1])
    world.add(box([-30, -0.5, -30], [30, -0.25, 30]), palette.floor(rng))
    _furnish(rng, world, size, set(openings))
    _look_around(rng, world, size)
    return world


def lamps(seed: int) -> World:
    """A room at night: bulbs inside shades, on tables, on stands and from the ceiling."""
    rng = np.random.default_rng([2, seed])
    size = _size(rng, 3.0, 5.5)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    _enclose(rng, world, size, {})
    _furnish(rng, world, size, set())
    for _ in range(int(rng.integers(1, 4))):
        _lamp(rng, world, size)
    _look_around(rng, world, size)
    return world


def shelves(seed: int) -> World:
    """A wall of shelves with clutter, from near, lit by a window or a lamp of another colour."""
    rng = np.random.default_rng([3, seed])
    size = (rng.uniform(2.8, 4.5), rng.uniform(2.4, 3.0), rng.uniform(2.5, 4.0))
    world = World(ao_distance=rng.uniform(0.25, 0.8), fov_x=(45.0, 75.0))
    side_name = str(rng.choice(["left", "right"]))
    side = sides(size[0], size[2])[side_name]
    hole = Opening(-rng.uniform(0.4, 0.9), rng.uniform(0.4, 0.9), 0.8, rng.uniform(1.8, 2.3))
    _enclose(rng, world, size, {side_name: [hole]})
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


def _size(rng: np.random.Generator, low: float, high: float) -> Size:
    return rng.uniform(low, high), rng.uniform(2.4, 3.3), rng.uniform(low, high)


def _windows(rng: np.random.Generator, size: Size) -> dict[str, list[Opening]]:
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


def _enclose(
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


def _hang_curtains(
    rng: np.random.Generator, world: World, side: Side, hole: Opening, height: float
) -> None:
    items = furniture.curtain(rng, rng.uniform(0.3, 0.6), height - 0.15)
    for x in (hole.left - 0.1, hole.right + 0.1):
        side.put(world, placed(items, [x, 0.05, 0.14]))


def _ceiling_panel(rng: np.random.Generator, world: World, size: Size, strength: float) -> None:
    w, d = rng.uniform(0.3, 1.2, 2)
    x, z = size[0] / 2 - w / 2, size[2] / 2 - d / 2
    panel = quad([x, size[1] - 0.03, z], [w, 0, 0], [0, 0, d])
    world.shine(panel, palette.lamplight(rng) * strength)
    world.add(
        box([x - 0.03, size[1] - 0.025, z - 0.03], [x + w + 0.03, size[1], z + d + 0.03]),
        plain([0.6, 0.6, 0.6]),
    )


def _furnish(rng: np.random.Generator, world: World, size: Size, windows: set[str]) -> None:
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
        _along_wall(rng, world, side, height, name in windows)
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


def _lamp(rng: np.random.Generator, world: World, size: Size) -> None:
    """A ball of light inside an open shade: pendant, standing, or on a small table."""
    kind = int(rng.integers(3))
    x, z = rng.uniform(0.6, size[0] - 0.6), rng.uniform(0.6, size[2] - 0.6)
    y = (size[1] - rng.uniform(0.6, 1.0), rng.uniform(1.3, 1.7), rng.uniform(0.85, 1.05))[kind]
    tall, wide = rng.uniform(0.18, 0.32), rng.uniform(0.14, 0.25)
    narrow = wide * rng.uniform(0.45, 1.0)
    outer = [(wide, -tall / 2), (narrow, tall / 2)]
    shade = lathe(outer, 48).moved([x, y, z])
    world.add(shade, plain(np.clip(palette.pale(rng) * 1.05, 0, 0.9)))
    dark = plain(palette.grey(rng) * 0.4)
    if kind == 0:
        world.add(tube([[x, y, z], [x, (y + size[1]) / 2, z], [x, size[1], z]], 0.008, 8), dark)
    else:
        world.add(cylinder(0.015, y - tall * 0.3, 12).moved([x, 0, z]), dark)
        world.add(cylinder(0.14, 0.02).moved([x, 0, z]), dark)
        if kind == 2:
            stand = cylinder(0.25, 0.55).turned(rotation(0))
            world.add(stand.moved([x, 0, z]), palette.timber(rng))
    radius = rng.uniform(0.05, 0.09)
    bulb = palette.lamplight(rng) * 10 ** rng.uniform(1.5, 2.5)
    world.shine_ball([x, y - tall * rng.uniform(0, 0.2), z], radius, bulb)
    world.sights.append([x, y - 0.2, z])


def _look_around(rng: np.random.Generator, world: World, size: Size) -> None:
    """Lookouts at eye height, mostly near the walls."""
    for _ in range(24):
        x, z = (
            rng.choice([rng.uniform(0.3, 1.0), s - rng.uniform(0.3, 1.0), s * rng.random()])
            for s in (size[0], size[2])
        )
        world.lookouts.append([x, rng.uniform(0.9, min(1.9, size[1] - 0.4)), z])
