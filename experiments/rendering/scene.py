"""Mitsuba scenes: of our own worlds, and of any XML with its materials made Lambertian."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering.scenes.world import Material, Surface, World


def build(world: World) -> Any:
    """The Mitsuba scene of a `World`: surfaces of one material become one mesh."""
    content: dict[str, Any] = {"type": "scene"}
    groups: dict[tuple[Any, ...], list[Surface]] = {}
    for surface in world.surfaces:
        groups.setdefault(_group(surface), []).append(surface)
    for number, group in enumerate(groups.values()):
        name = group[0].name or f"mesh{number:04}"
        content[name] = _mesh(name, group)
    for number, ball in enumerate(world.balls):
        content[f"ball{number:02}"] = {
            "type": "sphere",
            "center": list(ball.centre),
            "radius": ball.radius,
            "bsdf": lambertian(_reflectance(Material(np.zeros((1, 1, 3), np.float32)))),
            "emitter": {"type": "area", "radiance": _rgb(ball.radiance)},
        }
    if world.environment is not None:
        bitmap = mi.Bitmap(np.ascontiguousarray(world.environment, np.float32))
        content["sky"] = {"type": "envmap", "bitmap": bitmap}
    return mi.load_dict(content, parallel=False)


def lambertian(reflectance: dict[str, Any]) -> dict[str, Any]:
    """A diffuse material of both sides."""
    return {"type": "twosided", "nested": {"type": "diffuse", "reflectance": reflectance}}


def _rgb(values: tuple[float, float, float]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(values)}


def _reflectance(material: Material) -> dict[str, Any]:
    """A bitmap in every case, so that all scenes share their kernels."""
    scale = 1 / material.size
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(material.texture)),
        "raw": True,
        "to_uv": mi.ScalarTransform3f().scale([scale, scale]),
    }


def _group(surface: Surface) -> tuple[Any, ...]:
    """Surfaces that may become one mesh: same material (any plain colours), light and name."""
    if surface.radiance:
        return surface.radiance, surface.name
    texture = surface.material.texture
    return "plain" if texture.size == 3 else id(surface.material), surface.name


def _material(group: list[Surface]) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """The material of a group, and the texture coordinates of its meshes.

    Plain colours become texels of one row: hundreds of objects then cost one mesh.
    """
    first = group[0].material
    if first.texture.size > 3:
        return lambertian(_reflectance(first)), [s.mesh.uv for s in group]
    row = np.concatenate([s.material.texture for s in group], 1)
    colours = {"filter_type": "nearest", "wrap_mode": "clamp"}
    centres = [
        np.tile([(i + 0.5) / len(group), 0.5], (len(s.mesh.uv), 1)) for i, s in enumerate(group)
    ]
    return lambertian(_reflectance(Material(row)) | colours), centres


def _mesh(name: str, group: list[Surface]) -> Any:
    material, uv = _material(group)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(material)
    if group[0].radiance:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(group[0].radiance)})
    meshes = [s.mesh for s in group]
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    faces = np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=True)])
    vertices = np.concatenate([m.vertices for m in meshes])
    mesh = mi.Mesh(name, len(vertices), len(faces), properties, True, True)
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.astype(np.float32).ravel()
    values["vertex_normals"] = np.concatenate([m.normals for m in meshes]).astype("f4").ravel()
    values["vertex_texcoords"] = np.concatenate(uv).astype(np.float32).ravel()
    values["faces"] = faces.astype(np.uint32).ravel()
    values.update()
    return mesh
