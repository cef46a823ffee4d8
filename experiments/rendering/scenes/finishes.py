"""Materials besides diffuse ones, drawn by seed for the surfaces of any world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments.rendering.scenes.sky import gradient, sky
from experiments.rendering.scenes.world import DIFFUSE, Finish, Material, Surface, World

# Linear reflectances of metals at normal incidence.
METALS = (
    (1.0, 0.77, 0.34), (0.95, 0.64, 0.54), (0.97, 0.96, 0.91), (0.56, 0.57, 0.58),
    (0.91, 0.92, 0.92), (0.55, 0.46, 0.4),
)  # fmt: skip
GLASSES = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (0.85, 0.97, 0.9), (0.95, 0.6, 0.3), (0.5, 0.7, 0.95))
LARGE = 2.5  # metres across: walls, floors, ground
FEW = 7  # finishes of a scene for each size, so that its surfaces still share meshes


def dressed(world: World, rng: np.random.Generator) -> World:
    """The world with a finish for each of its materials, and often another sky."""
    large = [_large(rng) for _ in range(FEW)]
    small = [_small(rng) for _ in range(FEW)]
    chosen: dict[int, Material] = {}

    def finished(surface: Surface) -> Surface:
        material = surface.material
        if surface.radiance is None and id(material) not in chosen:
            wide = np.ptp(surface.mesh.vertices, axis=0).max() > LARGE
            kinds = large if wide else small
            chosen[id(material)] = replace(material, finish=kinds[int(rng.integers(FEW))])
        return replace(surface, material=chosen.get(id(material), material))

    environment = world.environment
    if environment is not None and rng.random() < 0.6:
        environment = gradient(rng) if rng.random() < 0.4 else sky(rng, 256, (0.5, 3.0))
    surfaces = [finished(surface) for surface in world.surfaces]
    return replace(world, surfaces=surfaces, environment=environment)


def _alpha(rng: np.random.Generator, low: float, high: float) -> float:
    """A roughness, evenly drawn on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _large(rng: np.random.Generator) -> Finish:
    kind = rng.choice(5, p=[0.45, 0.25, 0.15, 0.1, 0.05])
    if kind == 0:
        return DIFFUSE
    if kind < 3:
        low, high = ((0.1, 0.5), (0.01, 0.1))[kind - 1]
        return Finish("principled", _alpha(rng, low, high))
    if kind == 3:
        return Finish("plastic", 1.0)
    return Finish("principled", _alpha(rng, 0.02, 0.3), 1.0)


def _small(rng: np.random.Generator) -> Finish:
    kind = rng.choice(7, p=[0.28, 0.17, 0.13, 0.14, 0.12, 0.12, 0.04])
    if kind == 0:
        return DIFFUSE
    if kind == 1:
        return Finish("principled", _alpha(rng, 0.02, 0.5))
    if kind == 2:
        return Finish("principled", _alpha(rng, 0.1, 0.6), coat=1.0)
    if kind == 3:
        return Finish("plastic", 1.0)
    if kind == 4:
        return Finish("principled", _alpha(rng, 0.02, 0.4), float(rng.choice([0.5, 1.0])))
    return metal(rng) if kind == 5 else Finish("pane", 0.0, tint=_glass(rng))


def any_opaque(rng: np.random.Generator) -> Finish:
    """Of a surface whose size is not known."""
    finish = (_large, _small)[int(rng.random() < 0.5)](rng)
    return DIFFUSE if finish.kind == "pane" else finish


def metal(rng: np.random.Generator) -> Finish:
    """A metal, polished to a mirror in one case of three."""
    alpha = 0.0 if rng.random() < 1 / 3 else _alpha(rng, 0.02, 0.35)
    return Finish("metal", alpha, tint=METALS[int(rng.integers(len(METALS)))])


def glass(rng: np.random.Generator) -> Finish:
    """Solid glass, frosted in one case of four."""
    alpha = 0.0 if rng.random() < 0.75 else _alpha(rng, 0.03, 0.4)
    return Finish("glass", alpha, tint=_glass(rng))


def _glass(rng: np.random.Generator) -> tuple[float, float, float]:
    return GLASSES[int(rng.integers(len(GLASSES)))]
