"""Furniture and clutter: each function gives `(mesh, material)` pairs that stand on the origin."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from experiments.rendering.scenes import palette, textures
from experiments.rendering.scenes.geometry import (
    Array,
    Mesh,
    box,
    cylinder,
    join,
    lathe,
    quad,
    quads,
    rotation,
    sheet,
    sphere,
    tube,
)
from experiments.rendering.scenes.world import Material, plain

Items = list[tuple[Mesh, Material]]


def placed(items: Items, position: ArrayLike, degrees: float = 0.0, scale: float = 1.0) -> Items:
    """Turned about the vertical, scaled and moved."""
    matrix = rotation(degrees) * scale
    return [(mesh.turned(matrix).moved(position), material) for mesh, material in items]


def _legs(width: float, depth: float, height: float, thickness: float) -> Mesh:
    x, z = width / 2 - thickness, depth / 2 - thickness
    t = thickness / 2
    corners = [(sx * x, sz * z) for sx in (-1, 1) for sz in (-1, 1)]
    return join([box([cx - t, 0, cz - t], [cx + t, height, cz + t]) for cx, cz in corners])


def table(rng: np.random.Generator, width: float, depth: float, height: float = 0.74) -> Items:
    """A table, square or round."""
    material = palette.timber(rng)
    if rng.random() < 0.3:
        radius = min(width, depth) / 2
        foot = [(0.3 * radius, 0.0), (0.3 * radius, 0.03), (0.05, 0.08), (0.05, height - 0.03)]
        top = cylinder(radius, 0.04, 48).moved([0, height - 0.04, 0])
        return [(top, material), (lathe(foot), material)]
    top = box([-width / 2, height - 0.04, -depth / 2], [width / 2, height, depth / 2])
    return [(join([top, _legs(width, depth, height - 0.04, 0.06)]), material)]


def chair(rng: np.random.Generator) -> Items:
    """A chair whose back is towards -z."""
    width, seat = rng.uniform(0.4, 0.48), rng.uniform(0.43, 0.48)
    material = palette.timber(rng)
    frame = [_legs(width, width, seat, 0.04)]
    half = width / 2
    frame.append(box([-half, seat, -half], [half, seat + 0.04, half]))
    top = seat + rng.uniform(0.4, 0.55)
    if rng.random() < 0.5:
        frame.append(box([-half, seat + 0.12, -half], [half, top, -half + 0.03]))
    else:
        bars = np.linspace(-half + 0.02, half - 0.02, 5)
        frame += [box([x - 0.012, seat, -half], [x + 0.012, top, -half + 0.024]) for x in bars]
        frame.append(box([-half, top - 0.06, -half], [half, top, -half + 0.03]))
    cushion = box(
        [-half + 0.02, seat + 0.04, -half + 0.03], [half - 0.02, seat + 0.07, half - 0.02]
    )
    return [(join(frame), material), (cushion, palette.fabric(rng))]


def sofa(rng: np.random.Generator, width: float) -> Items:
    """A sofa whose back is towards -z."""
    fabric, depth, half = palette.fabric(rng), 0.9, width / 2
    body = [
        pillow(width, 0.28, depth, 0.5).moved([0, 0.24, 0]),
        pillow(width, 0.55, 0.24, 0.45).moved([0, 0.58, -depth / 2 + 0.1]),
    ]
    body += [pillow(0.2, 0.5, depth, 0.4).moved([s * half, 0.35, 0]) for s in (-1, 1)]
    items: Items = [(join(body), fabric)]
    for x in rng.uniform(-half * 0.7, half * 0.7, int(rng.integers(0, 4))):
        cushion = pillow(0.42, 0.4, 0.16, 0.7).turned(rotation(rng.uniform(-25, 5), "x"))
        items.append((cushion.moved([x, 0.58, -0.12]), palette.fabric(rng)))
    return items


def pillow(width: float, height: float, depth: float, softness: float) -> Mesh:
    """A superellipsoid: a soft box about the origin."""
    v, u = np.meshgrid(
        np.linspace(-np.pi / 2, np.pi / 2, 17), np.linspace(0, 2 * np.pi, 33), indexing="ij"
    )

    def power(x: Array) -> Array:
        return np.sign(x) * np.abs(x) ** softness

    cv = power(np.maximum(np.cos(v), 0))
    points = np.stack([-cv * power(np.sin(u)), power(np.sin(v)), cv * power(np.cos(u))], -1)
    return sheet(points * np.array([width, height, depth]) / 2)


def shelf(rng: np.random.Generator, width: float, height: float, depth: float = 0.3) -> Items:
    """A shelf full of clutter, its back towards -z."""
    material = palette.timber(rng)
    boards = int(max(2, round(height / rng.uniform(0.3, 0.42))))
    levels = np.linspace(0.06, height - 0.02, boards + 1)
    half, t = width / 2, 0.02
    frame = [box([s * half - t, 0, 0], [s * half + t, height, depth]) for s in (-1, 1)]
    frame += [box([-half, y - t, 0], [half, y, depth]) for y in levels]
    frame.append(box([-half, 0, -0.01], [half, height, 0.005]))
    items: Items = [(join(frame), material)]
    for low, high in pairwise(levels):
        items += clutter_row(rng, -half + 0.04, half - 0.04, low, high - low - 0.04, depth)
    return items


def clutter_row(
    rng: np.random.Generator, left: float, right: float, y: float, room: float, depth: float
) -> Items:
    """Books and small things side by side along x, on the height `y`, at most `room` tall."""
    items: Items = []
    x = left
    while x < right - 0.05:
        if rng.random() < 0.72:
            count = int(rng.integers(2, 9))
            items += books(rng, x, min(right, x + 0.05 * count), y, room, depth)
            x += 0.05 * count
        else:
            size = min(rng.uniform(0.1, 0.24), room * 0.95)
            if x + size < right:
                item = small_thing(rng, size)
                items += placed(item, [x + size / 2, y, depth / 2], rng.uniform(0, 90))
            x += size + 0.02
        x += rng.choice([0.0, 0.02, 0.15])
    return items


def books(
    rng: np.random.Generator, left: float, right: float, y: float, room: float, depth: float
) -> Items:
    """Upright books from `left` to `right`."""
    items: Items = []
    x = left
    while x < right - 0.02:
        t, h = rng.uniform(0.015, 0.05), room * rng.uniform(0.6, 0.98)
        front = depth * rng.uniform(0.7, 0.95)
        items.append(
            (box([x, y, 0.03], [min(x + t, right), y + h, front]), plain(palette.any_colour(rng)))
        )
        x += t + 0.002
    return items


def small_thing(rng: np.random.Generator, size: float) -> Items:
    """A vase, a ball, a box, a bowl or a stack: as tall as `size`."""
    kind = int(rng.integers(5))
    material = palette.fabric(rng)
    if kind == 0:
        return [(vase(rng, size), material)]
    if kind == 1:
        return [(sphere(size / 2, 32).moved([0, size / 2, 0]), material)]
    if kind == 2:
        w, d = size * rng.uniform(0.3, 0.5, 2)
        return [(box([-w, 0, -d], [w, size * rng.uniform(0.4, 1), d]), material)]
    if kind == 3:
        profile = [
            (0.02, 0.0),
            (size * 0.2, 0.0),
            (size * 0.5, size * 0.4),
            (size * 0.46, size * 0.4),
            (size * 0.18, size * 0.05),
            (0.0, size * 0.05),
        ]
        return [(lathe(profile), material)]
    items: Items = []
    for level in range(int(rng.integers(2, 5))):
        w, d, h = size * 0.45, size * 0.33, size / 5
        block = box([-w, 0, -d], [w, h, d]).turned(rotation(rng.uniform(-15, 15)))
        items.append((block.moved([0, level * h, 0]), plain(palette.any_colour(rng))))
    return items


def vase(rng: np.random.Generator, height: float) -> Mesh:
    """A turned vase, open at the top."""
    t = np.linspace(0, 1, 20)
    bulge = rng.uniform(0.15, 0.3) * np.sin(np.pi * np.clip(t ** rng.uniform(0.6, 1.6), 0, 1))
    radius = height * (0.12 + bulge + rng.uniform(-0.05, 0.08) * t**3)
    return lathe([(0.0, 0.0), *zip(radius, height * t, strict=True)], 40)


def plant(rng: np.random.Generator, height: float) -> Items:
    """A pot with leaves."""
    pot = lathe([(0.0, 0.0), (0.12, 0.0), (0.17, 0.28), (0.15, 0.28), (0.14, 0.22), (0, 0.22)])
    items: Items = [(pot, palette.fabric(rng))]
    material = plain(palette.leaf(rng))
    crown = height - 0.25
    count = int(rng.integers(60, 220))
    centre = rng.normal(size=(count, 3)) * [0.16, 0.3, 0.16] * crown + [0, 0.3 + crown * 0.55, 0]
    centre[:, 1] = np.maximum(centre[:, 1], 0.28)
    items.append((leaves(rng, centre, rng.uniform(0.03, 0.09)), material))
    items.append(
        (
            tube([[0, 0.2, 0], [0.01, 0.5, 0], [0, height * 0.7, 0.01]], 0.015, 8),
            plain(palette.wood(rng)),
        )
    )
    return items


def leaves(rng: np.random.Generator, centres: Array, size: float) -> Mesh:
    """Small random quads `(N, 3)` of half length `size`."""
    u = rng.normal(size=centres.shape)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(u, rng.normal(size=centres.shape))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    length = size * rng.uniform(0.6, 1.3, (len(centres), 1))
    return quads(centres, u * length, v * length * 0.45)


def picture(rng: np.random.Generator, width: float, height: float) -> Items:
    """A framed picture that hangs with its back at z = 0, its centre at the origin."""
    canvas = palette.textured(rng, textures.painting, palette.vivid(rng), max(width, height))
    w, h, t = width / 2, height / 2, 0.03
    frame = [box([-w - t, s * h - t, 0], [w + t, s * h + t, 0.03]) for s in (-1, 1)]
    frame += [box([s * w - t, -h, 0], [s * w + t, h, 0.03]) for s in (-1, 1)]
    face = quad([-w, -h, 0.015], [width, 0, 0], [0, height, 0])
    return [(face, canvas), (join(frame), palette.timber(rng))]


def curtain(rng: np.random.Generator, width: float, height: float) -> Items:
    """A wavy curtain that hangs from y = height, its middle at x = 0, waves along z."""
    x = np.linspace(-width / 2, width / 2, 60)
    folds = rng.uniform(6, 12) * width
    z = 0.04 * np.sin(2 * np.pi * folds * x / max(width, 0.1) + rng.uniform(0, 6))
    rows = np.stack(
        [np.c_[x, np.full(60, y), z * (1.2 - 0.4 * y / height)] for y in np.linspace(0, height, 6)]
    )
    return [(sheet(rows), palette.fabric(rng))]


def carpet(rng: np.random.Generator, width: float, depth: float) -> Items:
    """A rug with one picture over its whole size."""
    size = max(width, depth)
    material = palette.textured(rng, textures.rug, palette.vivid(rng), size)
    top = quad([-width / 2, 0.012, depth / 2], [width, 0, 0], [0, 0, -depth])
    return [(top, material)]


def cabinet(rng: np.random.Generator, width: float, height: float, depth: float = 0.45) -> Items:
    """A cupboard with doors, its back towards -z."""
    body = box([-width / 2, 0.05, 0], [width / 2, height, depth])
    doors = int(max(1, round(width / 0.5)))
    edges = np.linspace(-width / 2, width / 2, doors + 1)
    fronts = [
        box([a + 0.01, 0.08, depth], [b - 0.01, height - 0.03, depth + 0.02])
        for a, b in pairwise(edges)
    ]
    material = palette.timber(rng)
    return [
        (body, material),
        (join(fronts), palette.timber(rng) if rng.random() < 0.3 else material),
    ]


def bed(rng: np.random.Generator, width: float) -> Items:
    """A bed whose head is towards -z."""
    w = width / 2
    frame = join([box([-w, 0.05, -1.05], [w, 0.28, 1.05]), box([-w, 0, -1.1], [w, 1.0, -1.03])])
    mattress = pillow(width * 1.04, 0.3, 2.16, 0.25).moved([0, 0.38, 0])
    pillows = join([pillow(0.6, 0.16, 0.4, 0.6).moved([x, 0.56, -0.8]) for x in (-w / 2, w / 2)])
    return [
        (frame, palette.timber(rng)),
        (mattress, palette.fabric(rng)),
        (pillows, palette.fabric(rng)),
    ]
