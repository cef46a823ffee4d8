"""A scene as plain data: surfaces with a material, lights, and places to look from.

Nothing here knows the renderer; `experiments.rendering.scene` builds a Mitsuba scene of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.rendering.scenes.geometry import Mesh


@dataclass(frozen=True)
class Finish:
    """What a surface does besides reflecting diffusely: `diffuse`, `principled`, `plastic` (under a
    smooth coat), `metal`, or `glass` (solid) and `pane` (thin), which transmit.

    `alpha` is the GGX roughness, 0 for mirrors and clear glass, 1 for none; `tint` (3,) colours
    metals and glass, whose textures do not count.
    """

    kind: str = "diffuse"
    alpha: float = 1.0
    metallic: float = 0.0
    coat: float = 0.0
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


DIFFUSE = Finish()


@dataclass(frozen=True)
class Material:
    """Diffuse reflectance: a texture `(h, w, 3)`, linear, repeated every `size` metres."""

    texture: NDArray[np.float32]
    size: float = 1.0
    finish: Finish = DIFFUSE


def plain(colour: ArrayLike) -> Material:
    """One colour (3,) all over."""
    return Material(np.clip(np.asarray(colour, np.float32), 0.0, 0.95).reshape(1, 1, 3))


@dataclass(frozen=True)
class Surface:
    """A mesh of one material; it shines on its front where `radiance` (3,) is given."""

    mesh: Mesh
    material: Material
    radiance: tuple[float, float, float] | None = None
    name: str = ""


@dataclass(frozen=True)
class Ball:
    """A round lamp or a near sun; its light is sampled by the solid angle that it fills."""

    centre: tuple[float, float, float]
    radius: float
    radiance: tuple[float, float, float]


@dataclass(frozen=True)
class Glimpse:
    """A view worth rendering: from `origin` towards `target`."""

    origin: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_x: float


@dataclass
class World:
    """Everything of a scene. `environment` is a latitude-longitude map `(h, w, 3)` or None.

    `lookouts` are points `(N, 3)` where a camera may stand and `sights` points worth looking at.
    `transparent` is the share of its whole pictures whose film has no environment.
    """

    ao_distance: float
    surfaces: list[Surface] = field(default_factory=list)
    balls: list[Ball] = field(default_factory=list)
    environment: NDArray[np.float32] | None = None
    lookouts: list[ArrayLike] = field(default_factory=list)
    sights: list[ArrayLike] = field(default_factory=list)
    fov_x: tuple[float, float] = (55.0, 80.0)
    view: Glimpse | None = None
    transparent: float = 0.3

    def add(self, mesh: Mesh, material: Material, name: str = "") -> None:
        self.surfaces.append(Surface(mesh, material, None, name))

    def shine(self, mesh: Mesh, radiance: ArrayLike, name: str = "") -> None:
        """Add a lamp of any form; `radiance` is (3,)."""
        self.surfaces.append(Surface(mesh, plain([0, 0, 0]), _triple(radiance), name))

    def shine_ball(self, centre: ArrayLike, radius: float, radiance: ArrayLike) -> None:
        self.balls.append(Ball(_triple(centre), float(radius), _triple(radiance)))

    def add_all(self, items: Iterable[tuple[Mesh, Material]]) -> None:
        for mesh, material in items:
            self.add(mesh, material)


def _triple(values: ArrayLike) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in np.asarray(values, float))
    return x, y, z
