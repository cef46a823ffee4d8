"""Rooms at night, lit by bulbs in shades."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import interior, palette
from experiments.rendering.scenes.geometry import cylinder, lathe, rotation, tube
from experiments.rendering.scenes.interior import Size
from experiments.rendering.scenes.world import World, plain


def lamps(seed: int) -> World:
    """A room at night: bulbs inside shades, on tables, on stands and from the ceiling."""
    rng = np.random.default_rng([2, seed])
    world, size = _night(rng, 5.5)
    for _ in range(int(rng.integers(1, 4))):
        _lamp(rng, world, size)
    interior.look_around(rng, world, size)
    return world


def lanterns(seed: int) -> World:
    """A room at night with a lamp, and small bulbs deep in shades with narrow mouths.

    Few samples find the bright spots that these make and the inside of their shades: fireflies.
    """
    rng = np.random.default_rng([13, seed])
    world, size = _night(rng, 5.0)
    _lamp(rng, world, size)
    for _ in range(int(rng.integers(1, 3))):
        _lantern(rng, world, size)
    interior.look_around(rng, world, size)
    return world


def _night(rng: np.random.Generator, widest: float) -> tuple[World, Size]:
    """A furnished room without windows, and its size."""
    size = interior.room_size(rng, 3.0, widest)
    world = World(ao_distance=rng.uniform(0.6, 1.5))
    interior.enclose(rng, world, size, {})
    interior.furnish(rng, world, size, set())
    return world, size


def _lamp(rng: np.random.Generator, world: World, size: Size) -> None:
    """A ball of light inside an open shade: pendant, standing, or on a small table."""
    kind, x, y, z = _place(rng, size)
    tall, wide = rng.uniform(0.18, 0.32), rng.uniform(0.14, 0.25)
    narrow = wide * rng.uniform(0.45, 1.0)
    outer = [(wide, -tall / 2), (narrow, tall / 2)]
    world.add(lathe(outer, 48).moved([x, y, z]), plain(np.clip(palette.pale(rng) * 1.05, 0, 0.9)))
    _hold(rng, world, size, kind, [x, y, z], tall)
    radius = rng.uniform(0.05, 0.09)
    bulb = palette.lamplight(rng) * 10 ** rng.uniform(1.5, 2.5)
    world.shine_ball([x, y - tall * rng.uniform(0, 0.2), z], radius, bulb)
    world.sights.append([x, y - 0.2, z])


def _lantern(rng: np.random.Generator, world: World, size: Size) -> None:
    """A small bulb at the bottom of a bellied shade that is open at one end only, or nearly so."""
    kind, x, y, z = _place(rng, size)
    tall, wide = rng.uniform(0.2, 0.4), rng.uniform(0.08, 0.16)
    mouth, back = wide * rng.uniform(0.4, 0.9), rng.choice([0.0, 0.02])
    outer = [(mouth, -tall / 2), (wide, -tall * 0.2), (wide, tall * 0.35), (back, tall / 2)]
    up = -1.0 if kind != 0 and rng.random() < 0.5 else 1.0
    shade = lathe([(r, up * h) for r, h in outer[:: int(up)]], 48)
    world.add(shade.moved([x, y, z]), plain(np.clip(palette.pale(rng) * 1.05, 0, 0.9)))
    _hold(rng, world, size, kind, [x, y, z], tall)
    bulb = palette.lamplight(rng) * 10 ** rng.uniform(2.5, 3.5)
    depth = up * tall * rng.uniform(0.0, 0.25)
    world.shine_ball([x, y + depth, z], rng.uniform(0.02, 0.04), bulb)
    world.sights.append([x, y - 0.2, z])


def _place(rng: np.random.Generator, size: Size) -> tuple[int, float, float, float]:
    """Pendant (0), standing (1) or on a table (2), and where its shade is."""
    kind = int(rng.integers(3))
    x, z = rng.uniform(0.6, size[0] - 0.6), rng.uniform(0.6, size[2] - 0.6)
    y = (size[1] - rng.uniform(0.6, 1.0), rng.uniform(1.3, 1.7), rng.uniform(0.85, 1.05))[kind]
    return kind, x, y, z


def _hold(
    rng: np.random.Generator, world: World, size: Size, kind: int, at: list[float], tall: float
) -> None:
    """What a shade of height `tall` at a place hangs from or stands on."""
    x, y, z = at
    dark = plain(palette.grey(rng) * 0.4)
    if kind == 0:
        world.add(tube([[x, y, z], [x, (y + size[1]) / 2, z], [x, size[1], z]], 0.008, 8), dark)
        return
    world.add(cylinder(0.015, y - tall * 0.3, 12).moved([x, 0, z]), dark)
    world.add(cylinder(0.14, 0.02).moved([x, 0, z]), dark)
    if kind == 2:
        stand = cylinder(0.25, 0.55).turned(rotation(0))
        world.add(stand.moved([x, 0, z]), palette.timber(rng))
