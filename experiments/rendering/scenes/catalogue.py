"""All families of scenes, by name: each a function of a seed."""

from __future__ import annotations

from collections.abc import Callable

from experiments.rendering.scenes import (
    airy,
    colonnade,
    forms,
    nature,
    night,
    palette,
    passages,
    rooms,
)
from experiments.rendering.scenes.room import room
from experiments.rendering.scenes.world import World

FAMILIES: dict[str, Callable[[int], World]] = {
    "furnished": rooms.furnished,
    "sunlit": rooms.sunlit,
    "corridor": passages.corridor,
    "colonnade": colonnade.colonnade,
    "stairs": passages.stairs,
    "shelves": rooms.shelves,
    "foliage": nature.foliage,
    "forms": forms.forms,
    "terrain": nature.terrain,
    "cave": nature.cave,
    "hall": passages.hall,
    "lamps": night.lamps,
    "lanterns": night.lanterns,
}

# Worth a picture with all its light and materials only.
OF_PICTURES: dict[str, Callable[[int], World]] = {"airy": airy.airy}

CALM = 2000  # the first seed of calm colours


def world_of(name: str) -> World:
    """The scene `room`, or `FAMILY-SEED`, such as `stairs-3`.

    Scenes from seed 2000 on have the colours of paint and cloth, those before of plastic.

    Raises ValueError for an unknown name.
    """
    family, _, seed = name.partition("-")
    if name == "room":
        return room()
    families = FAMILIES | OF_PICTURES
    if family not in families or not seed.isdigit():
        known = ", ".join(f"{f}-SEED" for f in families)
        raise ValueError(f"there is no scene {name!r} of ours: use room, {known}")
    world = families[family](int(seed))
    return world if int(seed) < CALM else palette.calm(world, int(seed))
