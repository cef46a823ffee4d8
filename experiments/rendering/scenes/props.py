"""Things put where a camera sees them: glass, mirrors, bulbs, screens, wires, grass, leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.rendering.scenes import finishes, forms, furniture, palette, textures
from experiments.rendering.scenes.geometry import Array, Mesh, box, join, quad, quads, sphere, tube
from experiments.rendering.scenes.world import Ball, Finish, Material, Surface, plain
from jflnr.camera import Camera

Things = list[Surface | Ball]
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Seen:
    """What a camera sees of a scene: points `(N, 3)` in front of it, their normals and depths."""

    camera: Camera
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    depth: NDArray[np.float32]

    def spot(
        self, rng: np.random.Generator, lies: bool | None = None
    ) -> tuple[Array, Array, float]:
        """A point, its normal, and how wide the picture is there; on level ground, or on a wall."""
        level = self.normal[:, 1] > 0.9
        steep = np.abs(self.normal[:, 1]) < 0.2
        fitting = np.flatnonzero(np.ones_like(level) if lies is None else level if lies else steep)
        if not len(fitting):
            fitting = np.arange(len(self.depth))
        i = int(rng.choice(fitting))
        wide = 2 * np.tan(np.radians(self.camera.fov_x) / 2) * float(self.depth[i])
        return self.position[i].astype(float), self.normal[i].astype(float), wide


def props(rng: np.random.Generator, seen: Seen) -> Things:
    """Three to seven things of random kinds."""
    kinds = rng.choice(len(KINDS), int(rng.integers(3, 8)), p=[share for _, share in KINDS])
    return [thing for kind in kinds for thing in KINDS[kind][0](rng, seen)]


def _standing(rng: np.random.Generator, seen: Seen) -> Things:
    """A closed form of glass or metal, rarely of another material, where it can stand."""
    spot, _, wide = seen.spot(rng, True)
    size = min(wide * rng.uniform(0.05, 0.2), 0.6)
    shape = int(rng.integers(4))
    if shape == 0:
        mesh = sphere(1.0, 48)
    elif shape == 1:
        mesh = box([-0.7, -1, -0.7], [0.7, 1, 0.7])
    else:
        mesh = forms.FORMS[(0, 1, 2, 6)[int(rng.integers(4))]](rng)
    mesh = mesh.turned(np.eye(3) * size / 2)
    mesh = mesh.moved(spot - [0, mesh.vertices[:, 1].min() - 0.001 * size, 0])
    finish = (finishes.glass, finishes.metal)[int(rng.random() < 0.4)](rng)
    if rng.random() < 0.15:
        finish = Finish("principled", 0.15, coat=1.0)
    return [Surface(mesh, replace(palette.fabric(rng), finish=finish))]


def _vase(rng: np.random.Generator, seen: Seen) -> Things:
    """A thin vase of glass with twigs in it."""
    spot, _, wide = seen.spot(rng, True)
    size = min(wide * rng.uniform(0.08, 0.25), 0.7)
    pane = Material(plain([1, 1, 1]).texture, finish=Finish("pane", 0.0, tint=(0.9, 0.97, 0.95)))
    twigs = []
    for _ in range(int(rng.integers(3, 9))):
        end = rng.normal(size=3) * [0.35, 0.1, 0.35] * size + [0, size * rng.uniform(1.2, 1.9), 0]
        t = np.linspace(0, 1, 8)[:, None]
        twigs.append(tube(t * end + t * (1 - t) * rng.normal(size=3) * 0.2 * size, 0.008 * size, 6))
    stems = Surface(join(twigs).moved(spot), plain(palette.leaf(rng)))
    return [Surface(furniture.vase(rng, size).moved(spot), pane), stems]


def _bulbs(rng: np.random.Generator, seen: Seen) -> Things:
    """One to five small bright bulbs of one colour, off the surfaces."""
    colour = palette.lamplight(rng) * 10 ** rng.uniform(0.7, 2.0)
    things: Things = []
    for _ in range(int(rng.integers(1, 6))):
        spot, normal, wide = seen.spot(rng)
        radius = wide * 10 ** rng.uniform(-2.7, -1.8)
        centre = spot + normal * (radius * 2 + wide * rng.uniform(0, 0.1))
        things.append(Ball(tuple(centre), radius, tuple(colour)))
    return things


def _frame_on(rng: np.random.Generator, seen: Seen) -> tuple[Array, Array, Array, Array]:
    """A panel on a wall: corner, its sides, and the normal."""
    spot, normal, wide = seen.spot(rng, False)
    across = np.cross(UP, normal)
    across /= max(np.linalg.norm(across), 1e-6)
    w, h = wide * rng.uniform(0.1, 0.35, 2)
    u, v = across * w, np.cross(normal, across) * h
    return spot + normal * wide * 0.004 - (u + v) / 2, u, v, normal


def _panel(corner: Array, u: Array, v: Array, material: Material) -> Surface:
    """A parallelogram with one picture of a texture over all of it."""
    mesh = quad(corner, u, v)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    return Surface(Mesh(mesh.vertices, mesh.normals, uv, mesh.faces), material)


def _mirror(rng: np.random.Generator, seen: Seen) -> Things:
    """A mirror on a wall, mostly clear."""
    corner, u, v, _ = _frame_on(rng, seen)
    alpha = 0.0 if rng.random() < 0.7 else rng.uniform(0.02, 0.2)
    finish = Finish("metal", float(alpha), tint=(0.95, 0.95, 0.95))
    return [_panel(corner, u, v, Material(plain([0.9] * 3).texture, finish=finish))]


def _glazed(rng: np.random.Generator, seen: Seen) -> Things:
    """A picture behind a pane of glass."""
    corner, u, v, normal = _frame_on(rng, seen)
    kind = textures.painting if rng.random() < 0.5 else textures.checks
    picture = palette.textured(rng, kind, palette.vivid(rng))
    alpha = 0.0 if rng.random() < 0.7 else rng.uniform(0.03, 0.2)
    finish = Finish("glass", float(alpha)) if alpha else Finish("pane", 0.0)
    pane = Material(plain([1, 1, 1]).texture, finish=finish)
    gap = normal * np.linalg.norm(u) * rng.uniform(0.02, 0.3)
    if not alpha:
        return [_panel(corner, u, v, picture), _panel(corner + gap, u, v, pane)]
    slab = [quad(corner + gap, u, v).flipped(), quad(corner + 1.1 * gap, u, v)]
    return [_panel(corner, u, v, picture), Surface(join(slab), pane)]


def _screen(rng: np.random.Generator, seen: Seen) -> Things:
    """A plain or striped surface that shines."""
    corner, u, v, _ = _frame_on(rng, seen)
    strips = int(rng.choice([1, 1, 3, 8]))
    light = palette.vivid(rng) * 10 ** rng.uniform(0, 1.2) + 0.2
    material = plain([0, 0, 0])
    radiance = (float(light[0]), float(light[1]), float(light[2]))
    step = u / strips
    meshes = [quad(corner + step * i, step * rng.uniform(0.3, 0.9), v) for i in range(strips)]
    return [Surface(join(meshes), material, radiance)]


def _wires(rng: np.random.Generator, seen: Seen) -> Things:
    """Thin wires through the room, some bundled, from half a pixel to three wide."""
    material = plain(palette.any_colour(rng))
    if rng.random() < 0.4:
        material = replace(material, finish=finishes.metal(rng))
    wires = []
    for _ in range(int(rng.integers(1, 5))):
        a, normal, wide = seen.spot(rng)
        b, other, _ = seen.spot(rng)
        a, b = a + normal * 0.1 * wide * rng.random(), b + other * 0.1 * wide * rng.random()
        t = np.linspace(0, 1, 24)[:, None]
        sag = UP * np.linalg.norm(b - a) * rng.uniform(0, 0.15)
        radius = wide / 640 * 10 ** rng.uniform(-0.3, 0.5)
        for i in range(int(rng.choice([1, 1, 2, 5]))):
            offset = rng.normal(size=3) * radius * 8 * (i > 0)
            wires.append(tube(a + t * (b - a) - 4 * t * (1 - t) * sag + offset, radius, 6))
    return [Surface(join(wires), material)]


def _bars(rng: np.random.Generator, seen: Seen) -> Things:
    """A grid of thin bars before a part of the view."""
    spot, _, wide = seen.spot(rng)
    eye = seen.camera.to_world[:3, 3]
    share = rng.uniform(0.35, 0.85)
    middle, span = eye + share * (spot - eye), wide * share * rng.uniform(0.2, 0.6)
    left, up = seen.camera.to_world[:3, 0], seen.camera.to_world[:3, 1]
    radius = wide * share / 640 * 10 ** rng.uniform(-0.2, 0.7)
    bars = []
    for along, across in ((left, up), (up, left))[: int(rng.integers(1, 3))]:
        for k in np.linspace(-0.5, 0.5, int(rng.integers(4, 14))):
            ends = [middle + across * span * k + along * span * e for e in (-0.5, 0.0, 0.5)]
            bars.append(tube(ends, radius, 6))
    material = plain(palette.any_colour(rng))
    if rng.random() < 0.5:
        material = replace(material, finish=finishes.metal(rng))
    return [Surface(join(bars), material)]


def _grass(rng: np.random.Generator, seen: Seen) -> Things:
    """A tuft of hair-thin blades."""
    spot, normal, wide = seen.spot(rng)
    count, tall = int(rng.integers(80, 500)), wide * rng.uniform(0.04, 0.15)
    t = np.linspace(0, 1, 6)[:, None]
    blades = []
    for _ in range(count):
        foot = spot + np.cross(normal, rng.normal(size=3)) * tall * 0.6
        bend = rng.normal(size=3) * 0.35 * tall
        path = foot + t * normal * tall * rng.uniform(0.6, 1.2) + t**2 * bend
        blades.append(tube(path, wide / 640 * rng.uniform(0.3, 1.2) * (1.1 - t[:, 0]), 3))
    colour = palette.leaf(rng) if rng.random() < 0.6 else palette.any_colour(rng)
    return [Surface(join(blades), plain(colour))]


def _leaves(rng: np.random.Generator, seen: Seen) -> Things:
    """A twig full of leaves, near enough to the camera to be out of focus at times."""
    spot, _, wide = seen.spot(rng)
    eye = seen.camera.to_world[:3, 3]
    share = rng.uniform(0.3, 0.95)
    centre, span = eye + share * (spot - eye), wide * share * rng.uniform(0.05, 0.15)
    centres = centre + rng.normal(size=(int(rng.integers(20, 150)), 3)) * span
    finish = Finish("principled", 0.2) if rng.random() < 0.5 else Finish()
    leaf = replace(plain(palette.leaf(rng)), finish=finish)
    return [Surface(furniture.leaves(rng, centres, span * rng.uniform(0.1, 0.3)), leaf)]


def _window(rng: np.random.Generator, seen: Seen) -> Things:
    """A pane of glass that stands before a part of the view."""
    spot, _, wide = seen.spot(rng)
    eye = seen.camera.to_world[:3, 3]
    share = rng.uniform(0.4, 0.9)
    left, up, forward = seen.camera.to_world[:3, :3].T
    turned = left * np.cos(angle := rng.uniform(-0.8, 0.8)) + forward * np.sin(angle)
    w, h = wide * share * rng.uniform(0.15, 0.5, 2)
    middle = eye + share * (spot - eye)
    pane = quads(middle[None], turned[None] * w / 2, up[None] * h / 2)
    tint = finishes.GLASSES[int(rng.integers(len(finishes.GLASSES)))]
    return [
        Surface(pane, Material(plain([1, 1, 1]).texture, finish=Finish("pane", 0.0, tint=tint)))
    ]


KINDS: tuple[tuple[Callable[[np.random.Generator, Seen], Things], float], ...] = (
    (_standing, 0.27),
    (_vase, 0.06),
    (_bulbs, 0.1),
    (_mirror, 0.11),
    (_glazed, 0.08),
    (_screen, 0.07),
    (_wires, 0.1),
    (_bars, 0.07),
    (_grass, 0.06),
    (_leaves, 0.03),
    (_window, 0.05),
)
