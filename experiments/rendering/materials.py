"""Scenes with materials of all kinds and things in view, of our worlds and of scene files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mitsuba as mi
import numpy as np

from experiments.rendering.lambertian import load_text, make_lambertian
from experiments.rendering.scene import bsdf, build, groups
from experiments.rendering.scenes import finishes
from experiments.rendering.scenes.props import Seen, props
from experiments.rendering.scenes.world import Ball, Finish, World
from experiments.rendering.source import Source
from experiments.rendering.tracer import Image
from jflnr.camera import Camera

Element = ElementTree.Element


@dataclass(frozen=True)
class Dressed:
    """A Mitsuba scene, and the finish of each of its shapes by name."""

    scene: Any
    finishes: dict[str, Finish]


def dressed(
    source: Source, camera: Camera, guides: dict[str, Image], rng: np.random.Generator
) -> Dressed:
    """The scene of a source with random materials, and with things where the camera sees them.

    guides: of the diffuse scene as the camera sees it, `(H, W, C)`.
    """
    hit = guides["depth"][..., 0] > 0
    position, normal, depth = (guides[name][hit] for name in ("position", "normal", "depth"))
    things = props(rng, Seen(camera, position, normal, depth[:, 0]))
    world = World(0.0) if source.world is None else finishes.dressed(source.world, rng)
    balls = [thing for thing in things if isinstance(thing, Ball)]
    surfaces = [thing for thing in things if not isinstance(thing, Ball)]
    world = replace(world, surfaces=world.surfaces + surfaces, balls=world.balls + balls)
    found = {name: group[0].material.finish for name, group in groups(world).items()}
    scene = build(world, by_power=True)
    if source.path is None:
        return Dressed(scene, found)
    file, own = _file(source.path, rng)
    parts = [*file.shapes(), *scene.shapes(), *(e for e in file.emitters() if e.is_environment())]
    together = {part.id() or f"part{i}": part for i, part in enumerate(parts)}
    return Dressed(mi.load_dict({"type": "scene"} | together, parallel=False), found | own)


def _file(path: Path, rng: np.random.Generator) -> tuple[Any, dict[str, Finish]]:
    """The scene of a file with random materials, and the finishes of its shapes."""
    root = ElementTree.parse(path).getroot()
    make_lambertian(root)
    by_name: dict[str, Finish] = {}
    found: dict[str, Finish] = {}
    for material in root.findall("bsdf"):
        by_name[material.get("id", "")] = _refinish(material, rng)
    for i, shape in enumerate(root.findall("shape")):
        name = f"file{i:04}"
        shape.set("id", name)
        for material in shape.findall("bsdf"):
            found[name] = _refinish(material, rng)
        for reference in shape.findall("ref"):
            found[name] = by_name.get(reference.get("id", ""), Finish())
    return load_text(path, root, merged=False), found


def _refinish(material: Element, rng: np.random.Generator) -> Finish:
    """Give a diffuse material of both sides another finish, which is returned."""
    finish = finishes.any_opaque(rng)
    colour = material.find("bsdf/*")
    assert colour is not None
    made = _element("bsdf", bsdf(finish, {"type": "colour"}), colour)
    material.set("type", made.get("type", ""))
    material[:] = list(made)
    return finish


def _element(tag: str, content: dict[str, Any], colour: Element) -> Element:
    """The XML of what Mitsuba would load as a dictionary, `colour` put in where that is wanted."""
    made = ElementTree.Element(tag, {"type": content["type"]})
    for key, value in content.items():
        if key == "type":
            continue
        if isinstance(value, dict) and value["type"] == "colour":
            child = ElementTree.Element(colour.tag, colour.attrib | {"name": key})
            child[:] = list(colour)
        elif isinstance(value, dict) and value["type"] == "rgb":
            child = ElementTree.Element("rgb", name=key, value=" ".join(map(str, value["value"])))
        elif isinstance(value, dict):
            child = _element("bsdf", value, colour)
        else:
            kind = {bool: "boolean", str: "string"}.get(type(value), "float")
            child = ElementTree.Element(kind, name=key, value=str(value).lower())
        made.append(child)
    return made
