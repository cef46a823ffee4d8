"""Random colours and materials: saturated, grey, wooden, earthen, textured or plain."""

from __future__ import annotations

from collections.abc import Sequence
from colorsys import hsv_to_rgb
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.rendering.scenes import textures
from experiments.rendering.scenes.world import Material, World, plain

Array = NDArray[np.float64]


def linear(srgb: Sequence[float]) -> Array:
    """Linear reflectance of a colour as displays write it."""
    return np.asarray(srgb, float) ** 2.2


def vivid(rng: np.random.Generator) -> Array:
    """A saturated colour."""
    return linear(hsv_to_rgb(rng.random(), rng.uniform(0.45, 0.95), rng.uniform(0.45, 0.95)))


def pale(rng: np.random.Generator) -> Array:
    """The colour of a painted wall."""
    return linear(hsv_to_rgb(rng.random(), rng.uniform(0.0, 0.3), rng.uniform(0.7, 0.95)))


def grey(rng: np.random.Generator) -> Array:
    return linear(np.clip(rng.uniform(0.25, 0.95) + rng.uniform(-0.02, 0.02, 3), 0, 1).tolist())


def wood(rng: np.random.Generator) -> Array:
    return linear(
        hsv_to_rgb(rng.uniform(0.04, 0.11), rng.uniform(0.3, 0.75), rng.uniform(0.3, 0.85))
    )


def stone(rng: np.random.Generator) -> Array:
    return linear(
        hsv_to_rgb(rng.uniform(0.05, 0.15), rng.uniform(0.05, 0.35), rng.uniform(0.45, 0.85))
    )


def leaf(rng: np.random.Generator) -> Array:
    return linear(
        hsv_to_rgb(rng.uniform(0.2, 0.42), rng.uniform(0.4, 0.85), rng.uniform(0.25, 0.7))
    )


def any_colour(rng: np.random.Generator) -> Array:
    kinds = (vivid, pale, grey, wood, stone)
    return kinds[int(rng.choice(len(kinds), p=[0.35, 0.2, 0.2, 0.15, 0.1]))](rng)


def textured(
    rng: np.random.Generator,
    texture: textures.Texture,
    colour: Array,
    size: float = 1.0,
) -> Material:
    """A procedural texture that repeats every `size` metres."""
    return Material(textures.limited(texture(rng, colour)), size)


def wall(rng: np.random.Generator) -> Material:
    """Paint in most cases, else wallpaper, bricks, tiles or stone."""
    colour = vivid(rng) if rng.random() < 0.25 else pale(rng)
    return plain_or(rng, 0.45, colour, textures.WALLS, (0.8, 2.0))


def floor(rng: np.random.Generator) -> Material:
    texture = textures.FLOORS[int(rng.integers(len(textures.FLOORS)))]
    colour = wood(rng) if texture is textures.planks else any_colour(rng)
    return textured(rng, texture, colour, rng.uniform(1.0, 2.5))


def fabric(rng: np.random.Generator) -> Material:
    colour = vivid(rng) if rng.random() < 0.5 else any_colour(rng)
    return plain_or(rng, 0.4, colour, textures.FABRICS, (0.3, 1.0))


def plain_or(
    rng: np.random.Generator,
    share: float,
    colour: Array,
    choice: Sequence[textures.Texture],
    sizes: tuple[float, float],
) -> Material:
    """Plain in a share of cases, else one of several textures, of a size between two."""
    if rng.random() < share:
        return plain(colour)
    return textured(rng, choice[int(rng.integers(len(choice)))], colour, rng.uniform(*sizes))


def timber(rng: np.random.Generator) -> Material:
    """The material of a piece of furniture: wooden or painted."""
    if rng.random() < 0.5:
        return textured(rng, textures.planks, wood(rng), rng.uniform(0.8, 1.6))
    return plain(any_colour(rng))


def lamplight(rng: np.random.Generator) -> Array:
    """Colour of a light, mean 1: from candle to sky, rarely a strong colour."""
    if rng.random() < 0.15:
        colour = vivid(rng) + 0.1
    else:
        warmth = rng.uniform(-0.5, 1.0)
        colour = np.array([1 + 0.35 * warmth, 1.0, 1 - 0.5 * warmth])
    return colour / colour.mean()


def calm(world: World, seed: int) -> World:
    """The world with weaker colours; one surface in seven keeps its own."""
    rng = np.random.default_rng([40, seed])
    share = rng.uniform(0.2, 0.6)

    def faded(material: Material) -> Material:
        grey = material.texture.mean(-1, keepdims=True)
        kept = 1.0 if rng.random() < 1 / 7 else share
        return replace(material, texture=(grey + kept * (material.texture - grey)).astype("f4"))

    return replace(world, surfaces=[replace(s, material=faded(s.material)) for s in world.surfaces])
