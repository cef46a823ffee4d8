"""Walls, openings, windows and the light outside: the parts that rooms are built of.

A wall is built in a frame of its own: x along the wall, its inner side at z = 0 facing +z.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from experiments.rendering.scenes import palette
from experiments.rendering.scenes.furniture import Items, placed
from experiments.rendering.scenes.geometry import Array, Mesh, box, join, quad, rotation
from experiments.rendering.scenes.world import Material, World, plain


@dataclass(frozen=True)
class Opening:
    """A hole in a wall, in the wall's own frame."""

    left: float
    right: float
    low: float
    high: float

    @property
    def size(self) -> tuple[float, float]:
        return self.right - self.left, self.high - self.low

    @property
    def centre(self) -> Array:
        return np.array([(self.left + self.right) / 2, (self.low + self.high) / 2, 0.0])


@dataclass(frozen=True)
class Side:
    """Where a wall's own frame lies in the world: turned by `degrees`, then moved."""

    degrees: float
    offset: tuple[float, float, float]
    width: float

    def point(self, local: ArrayLike) -> Array:
        return rotation(self.degrees) @ np.asarray(local, float) + np.asarray(self.offset)

    def put(self, world: World, items: Items) -> None:
        world.add_all(placed(items, self.offset, self.degrees))


def sides(width: float, depth: float) -> dict[str, Side]:
    """The four walls of a room from (0, 0) to (width, depth), with their inner sides inwards."""
    return {
        "back": Side(0, (width / 2, 0, 0), width),
        "front": Side(180, (width / 2, 0, depth), width),
        "left": Side(90, (0, 0, depth / 2), depth),
        "right": Side(-90, (width, 0, depth / 2), depth),
    }


def pierced(width: float, height: float, openings: list[Opening], thickness: float) -> Mesh:
    """A wall with rectangular holes, centred at x = 0, standing on y = 0."""
    xs = sorted({-width / 2, width / 2, *(e for o in openings for e in (o.left, o.right))})
    ys = sorted({0.0, height, *(e for o in openings for e in (o.low, o.high))})
    blocks = []
    for x0, x1 in pairwise(xs):
        for y0, y1 in pairwise(ys):
            x, y = (x0 + x1) / 2, (y0 + y1) / 2
            if not any(o.left < x < o.right and o.low < y < o.high for o in openings):
                blocks.append(box([x0, y0, -thickness], [x1, y1, 0]))
    return join(blocks)


def window(rng: np.random.Generator, opening: Opening, thickness: float) -> Items:
    """Frame, bars and a sill for an opening."""
    (w, h), centre = opening.size, opening.centre
    material = plain(palette.linear([0.9] * 3)) if rng.random() < 0.7 else palette.timber(rng)
    t, z = 0.05, -thickness * 0.6
    bars = [box([-w / 2, s * h / 2 - t, z], [w / 2, s * h / 2 + t, z + t]) for s in (-1, 1)]
    bars += [box([s * w / 2 - t, -h / 2, z], [s * w / 2 + t, h / 2, z + t]) for s in (-1, 1)]
    for x in np.linspace(-w / 2, w / 2, int(rng.integers(2, 5)))[1:-1]:
        bars.append(box([x - 0.02, -h / 2, z], [x + 0.02, h / 2, z + 0.04]))
    if rng.random() < 0.6:
        y = h * rng.uniform(-0.1, 0.25)
        bars.append(box([-w / 2, y - 0.02, z], [w / 2, y + 0.02, z + 0.04]))
    bars.append(box([-w / 2 - 0.08, -h / 2 - 0.04, -thickness * 0.5], [w / 2 + 0.08, -h / 2, 0.12]))
    return [(join(bars).moved(centre), material)]


def daylight(
    rng: np.random.Generator, world: World, side: Side, opening: Opening, strength: float
) -> None:
    """A bright sky panel outside an opening and, mostly, a near sun that shines in beside it."""
    (w, h), distance = opening.size, rng.uniform(0.6, 1.5)
    x, y, _ = opening.centre
    w, h = w + 1.2 * distance, h + 1.2 * distance
    corner = side.point([x - w / 2, y - h / 2, -distance])
    turn = rotation(side.degrees)
    panel = quad(corner, turn @ [w, 0, 0], turn @ [0, h, 0])
    sky = palette.lamplight(rng) * 0.5 + np.array([0.35, 0.45, 0.6])
    world.shine(panel, sky * strength)
    if rng.random() < 0.6:
        slope = np.array([rng.uniform(-0.8, 0.8), rng.uniform(0.7, 1.4), -1.0])
        reach = rng.uniform(2.5, 5.0)
        slope *= min(1.0, 0.85 * distance * reach / max(distance, 1e-3)) / reach * reach
        start = side.point([x, y + opening.size[1] / 2, 0])
        centre = start + turn @ (slope * 0.8 * distance) + turn @ [0, 0.55 * h, 0]
        world.shine_ball(centre, 0.12, np.array([1.0, 0.85, 0.65]) * strength * 250)


def shell(
    world: World,
    size: tuple[float, float, float],
    walls: dict[str, Material],
    openings: dict[str, list[Opening]],
    floor: Material,
    ceiling: Material,
    thickness: float = 0.25,
) -> None:
    """Floor, ceiling and four walls of a room of width, height, depth, with their openings."""
    width, height, depth = size
    t = thickness
    world.add(box([-t, -0.2, -t], [width + t, 0, depth + t]), floor)
    world.add(box([-t, height, -t], [width + t, height + 0.2, depth + t]), ceiling)
    for name, side in sides(width, depth).items():
        extra = 2 * t if name in ("back", "front") else 0.0
        mesh = pierced(side.width + extra, height, openings.get(name, []), t)
        side.put(world, [(mesh, walls[name])])
