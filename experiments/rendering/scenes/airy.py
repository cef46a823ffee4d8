"""Things in the air, most as thin as pixels: what a film without a background is filled with."""

from __future__ import annotations

import numpy as np

from experiments.rendering.scenes import furniture, palette
from experiments.rendering.scenes.forms import FORMS
from experiments.rendering.scenes.geometry import Array, Mesh, join, quad, rotation, sphere, tube
from experiments.rendering.scenes.sky import gradient
from experiments.rendering.scenes.world import Glimpse, World, plain

PIXEL = 0.011  # metres, at the distance of the things, of a picture 320 pixels wide


def airy(seed: int) -> World:
    """Forms and balls before and behind rows of wires, tufts and leaves; no floor, some panels."""
    rng = np.random.default_rng([17, seed])
    world = World(ao_distance=rng.uniform(0.4, 1.2), transparent=0.75)
    world.environment = gradient(rng) * np.float32(10 ** rng.uniform(-0.7, 0))
    for _ in range(int(rng.integers(2, 7))):
        form = FORMS[int(rng.integers(len(FORMS)))](rng) if rng.random() < 0.6 else sphere(1, 48)
        spot = rng.uniform([-1.5, -0.8, -0.8], [1.5, 0.8, 0.8])
        world.add(form.turned(np.eye(3) * rng.uniform(0.15, 0.5)).moved(spot), palette.fabric(rng))
    for _ in range(int(rng.integers(1, 5))):
        kind = (_row, _row, _tuft, _twig)[int(rng.integers(4))]
        world.add(kind(rng), plain(palette.any_colour(rng)))
    for _ in range(int(rng.integers(1, 4))):
        w, h = 10 ** rng.uniform(-0.7, 0.3, 2)
        panel = quad([-w / 2, -h / 2, 0], [w, 0, 0], [0, h, 0]).turned(
            rotation(rng.uniform(20, 80), "x")
        )
        panel = panel.moved([0, rng.uniform(1.5, 3.5), -3.0]).turned(rotation(rng.uniform(0, 360)))
        world.shine(panel, palette.lamplight(rng) * 10 ** rng.uniform(0.3, 1.5) / np.sqrt(w * h))
    if rng.random() < 0.5:
        spot, light = rng.uniform(-1, 1, 3), palette.lamplight(rng) * 10 ** rng.uniform(0, 1)
        world.shine_ball(spot, rng.uniform(0.02, 0.2), light)
    angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(3.0, 4.5)
    eye = reach * np.sin(angle), rng.uniform(-0.6, 1.5), reach * np.cos(angle)
    world.view = Glimpse(eye, (0.0, 0.0, 0.0), rng.uniform(35, 60))
    return world


def _radius(rng: np.random.Generator) -> float:
    """From an eighth of a pixel to one and a half."""
    return PIXEL * 10 ** rng.uniform(-0.9, 0.2)


def _row(rng: np.random.Generator) -> Mesh:
    """Wires side by side, each a little turned, bent or straight."""
    count, radius = int(rng.integers(4, 40)), _radius(rng)
    along, beside = _directions(rng)
    middle = rng.uniform(-0.7, 0.7, 3)
    reach, spread = rng.uniform(0.5, 2.0), rng.uniform(0.3, 2.0)
    lean, bend = rng.uniform(0, 0.25), rng.uniform(0, 0.3) * (rng.random() < 0.4)
    t = np.linspace(-1, 1, 12)[:, None]
    wires = []
    for k in np.linspace(-spread, spread, count):
        slant = along + lean * rng.normal(size=3)
        path = middle + k * beside + reach * t * slant + bend * t**2 * rng.normal(size=3)
        wires.append(tube(path, radius, 6))
    return join(wires)


def _tuft(rng: np.random.Generator) -> Mesh:
    """Hairs that grow from a ball and end in a point."""
    centre, size = rng.uniform(-0.8, 0.8, 3), rng.uniform(0.2, 0.6)
    t = np.linspace(0, 1, 6)[:, None]
    hairs, radius = [], 2 * _radius(rng)
    for _ in range(int(rng.integers(100, 800))):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        path = centre + size * (0.3 * way + t * way + t**2 * rng.normal(size=3) * 0.2)
        hairs.append(tube(path, radius * (1.05 - t[:, 0]), 4))
    return join(hairs)


def _twig(rng: np.random.Generator) -> Mesh:
    """A cloud of small leaves."""
    centres = rng.uniform(-0.8, 0.8, 3) + rng.normal(size=(int(rng.integers(50, 500)), 3)) * 0.3
    return furniture.leaves(rng, centres, PIXEL * 10 ** rng.uniform(0, 0.9))


def _directions(rng: np.random.Generator) -> tuple[Array, Array]:
    """Two random directions at right angles."""
    along, beside = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    return along, beside
