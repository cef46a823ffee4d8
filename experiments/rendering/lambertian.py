"""Any Mitsuba 3 scene file, its materials replaced by Lambertian ones.

Diffuse reflectances and their textures are kept, metals keep their colour, wrappers are opened;
shapes of glass and other transmitting materials are dropped.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from jflnr.camera import Camera

Element = ElementTree.Element
COLOURS = ("reflectance", "diffuse_reflectance", "base_color", "specular_reflectance")
WRAPPERS = ("twosided", "mask", "bumpmap", "normalmap", "blendbsdf")
GLASS = ("dielectric", "roughdielectric", "thindielectric", "null")
GREY = "0.5 0.5 0.5"


Ball = tuple[NDArray[np.float64], float, str]


def load_xml(path: Path, ball: Ball | None = None) -> tuple[Any, Camera]:
    """The Lambertian scene of a Mitsuba 3 file, and its first camera.

    `ball`, a matrix (4, 4), a radius and a name, adds a chequered ball to the scene.

    Raises ValueError where the file is no scene that Mitsuba can load, or has no camera.
    """
    try:
        root = ElementTree.parse(path).getroot()
        make_lambertian(root)
        if ball:
            root.append(_ball(*ball))
        scene = load_text(path, root)
    except (ElementTree.ParseError, RuntimeError) as error:
        raise ValueError(
            f"Mitsuba cannot load {path}: {str(error).strip().splitlines()[-1]}"
        ) from error
    if not scene.sensors():
        raise ValueError(f"{path} has no camera (a <sensor>): add one")
    return scene, _camera(scene.sensors()[0], path)


def _ball(matrix: NDArray[np.float64], radius: float, name: str) -> Element:
    shape = ElementTree.Element("shape", type="sphere", id=name)
    transform = ElementTree.SubElement(shape, "transform", name="to_world")
    ElementTree.SubElement(transform, "scale", value=str(radius))
    values = " ".join(f"{v:.9g}" for v in matrix.ravel())
    ElementTree.SubElement(transform, "matrix", value=values)
    material = ElementTree.SubElement(shape, "bsdf", type="diffuse")
    texture = ElementTree.SubElement(material, "texture", type="checkerboard", name="reflectance")
    ElementTree.SubElement(texture, "rgb", name="color0", value="0.7 0.2 0.05")
    ElementTree.SubElement(texture, "rgb", name="color1", value="0.6 0.6 0.55")
    uv = ElementTree.SubElement(texture, "transform", name="to_uv")
    ElementTree.SubElement(uv, "scale", x="4", y="2")
    return shape


def load_text(path: Path, root: Element, merged: bool = True) -> Any:
    """The scene of `root`, which names its files as `path` does; shapes that go together `merged`.

    Mitsuba's loader waits for ever on a pool of one thread: lend it a second one.
    """
    resolver: Any = mi.file_resolver
    resolver().prepend(str(path.resolve().parent))
    threads = dr.thread_count()
    dr.set_thread_count(max(2, threads))
    try:
        return mi.load_string(ElementTree.tostring(root, "unicode"), optimize=merged)
    finally:
        dr.set_thread_count(threads)


def _camera(sensor: Any, path: Path) -> Camera:
    values = mi.traverse(sensor)
    if "x_fov" not in values:
        raise ValueError(f"the camera of {path} is no perspective camera")
    matrix = np.array(sensor.world_transform().matrix, float).reshape(4, 4)
    matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    return Camera(matrix, float(np.array(values["x_fov"]).ravel()[0]))


def make_lambertian(root: Element) -> None:
    """Replace the materials below `root` and drop the shapes whose material transmits light."""
    dropped = set()
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag != "bsdf" or parent.tag == "bsdf":
                continue
            if _base(child) is None:
                dropped.add(child.get("id"))
                parent.set("glass", "true")
            else:
                _replace(child)
    for parent in list(root.iter()):
        for child in list(parent):
            refers = {e.get("id") for e in child.findall("ref")} & (dropped - {None})
            if child.tag == "shape" and (child.get("glass") or refers):
                parent.remove(child)
    for element in root.iter():
        element.attrib.pop("glass", None)


def _base(material: Element) -> Element | None:
    """The innermost material that reflects, or None where there is only a transmitting one."""
    kind = material.get("type")
    if kind in GLASS:
        return None
    if kind in WRAPPERS:
        for nested in material.findall("bsdf"):
            return _base(nested)
    return material


def _replace(material: Element) -> None:
    base = _base(material)
    assert base is not None
    named = {
        child.get("name"): child for child in base if child.tag in ("rgb", "texture", "spectrum")
    }
    colour = next((named[name] for name in COLOURS if name in named), None)
    if colour is None:
        colour = ElementTree.Element("rgb", value=GREY)
    colour.set("name", "reflectance")
    for child in list(material):
        material.remove(child)
    material.set("type", "twosided")
    diffuse = ElementTree.SubElement(material, "bsdf", type="diffuse")
    diffuse.append(colour)
