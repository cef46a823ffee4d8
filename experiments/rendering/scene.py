"""Mitsuba scenes of our own worlds."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering.scenes.world import Finish, Material, Surface, World

SKY_AREA = 40.0  # square metres that a sky counts for among the lights


def build(world: World, by_power: bool = False) -> Any:
    """The Mitsuba scene of a `World`: surfaces of one material become one mesh.

    Lights are sampled alike, or those of more power more often.
    """
    content: dict[str, Any] = {"type": "scene"}
    for name, group in groups(world).items():
        content[name] = _mesh(name, group, by_power)
    for number, ball in enumerate(world.balls):
        content[f"ball{number:02}"] = {
            "type": "sphere",
            "center": list(ball.centre),
            "radius": ball.radius,
            "bsdf": lambertian(_reflectance(Material(np.zeros((1, 1, 3), np.float32)))),
            "emitter": _light(ball.radiance, 4 * np.pi * ball.radius**2, by_power),
        }
    if world.environment is not None:
        bitmap = mi.Bitmap(np.ascontiguousarray(world.environment, np.float32))
        content["sky"] = {"type": "envmap", "bitmap": bitmap}
        if by_power:
            content["sky"]["sampling_weight"] = _weight(world.environment.mean(), SKY_AREA)
    return mi.load_dict(content, parallel=False)


def groups(world: World) -> dict[str, list[Surface]]:
    """The surfaces of each mesh, by its name."""
    found: dict[tuple[Any, ...], list[Surface]] = {}
    for surface in world.surfaces:
        found.setdefault(_group(surface), []).append(surface)
    return {each[0].name or f"mesh{i:04}": each for i, each in enumerate(found.values())}


def lambertian(reflectance: dict[str, Any]) -> dict[str, Any]:
    """A diffuse material of both sides."""
    return {"type": "twosided", "nested": {"type": "diffuse", "reflectance": reflectance}}


def bsdf(finish: Finish, colour: dict[str, Any]) -> dict[str, Any]:
    """Mitsuba's material for a finish; `colour` is its texture."""
    if finish.kind == "diffuse":
        return lambertian(colour)
    made = {
        "principled": {
            "type": "principled",
            "base_color": colour,
            "roughness": finish.alpha**0.5,
            "metallic": finish.metallic,
            "clearcoat": finish.coat,
            "clearcoat_gloss": 1.0,
        },
        "plastic": {"type": "plastic", "diffuse_reflectance": colour, "nonlinear": True},
        "metal": {"material": "none", "specular_reflectance": _rgb(finish.tint)},
        "glass": {"specular_transmittance": _rgb(finish.tint)},
        "pane": {"type": "thindielectric", "specular_transmittance": _rgb(finish.tint)},
    }[finish.kind]
    rough = {"distribution": "ggx", "alpha": finish.alpha}
    if finish.kind == "metal":
        made |= {"type": "roughconductor"} | rough if finish.alpha else {"type": "conductor"}
    elif finish.kind == "glass":
        made |= {"type": "roughdielectric"} | rough if finish.alpha else {"type": "dielectric"}
    return made if finish.kind in ("glass", "pane") else {"type": "twosided", "nested": made}


def _weight(radiance: Any, area: float) -> float:
    """How often a light is sampled: weak ones near by are worth more than their power tells."""
    return float((np.mean(radiance) * area) ** 0.7) + 1e-6


def _light(radiance: tuple[float, float, float], area: float, by_power: bool) -> dict[str, Any]:
    weight = {"sampling_weight": _weight(radiance, area)} if by_power else {}
    return {"type": "area", "radiance": _rgb(radiance)} | weight


def _area(group: list[Surface]) -> float:
    corners = [s.mesh.vertices[s.mesh.faces] for s in group]
    sides = [np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners]
    return float(sum(np.linalg.norm(side, axis=1).sum() for side in sides)) / 2


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
    material = surface.material
    return "plain" if material.texture.size == 3 else id(material), material.finish, surface.name


def _material(group: list[Surface]) -> tuple[dict[str, Any], list[NDArray[np.float64]]]:
    """The material of a group, and the texture coordinates of its meshes.

    Plain colours become texels of one row: hundreds of objects then cost one mesh.
    """
    first = group[0].material
    if first.texture.size > 3:
        return bsdf(first.finish, _reflectance(first)), [s.mesh.uv for s in group]
    row = np.concatenate([s.material.texture for s in group], 1)
    colours = {"filter_type": "nearest", "wrap_mode": "clamp"}
    centres = [
        np.tile([(i + 0.5) / len(group), 0.5], (len(s.mesh.uv), 1)) for i, s in enumerate(group)
    ]
    return bsdf(first.finish, _reflectance(Material(row)) | colours), centres


def _mesh(name: str, group: list[Surface], by_power: bool) -> Any:
    material, uv = _material(group)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(material)
    if group[0].radiance:
        light = _light(group[0].radiance, _area(group), by_power)
        properties["emitter"] = mi.load_dict(light)
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
