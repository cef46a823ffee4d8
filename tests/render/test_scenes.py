"""The families of scenes, the views, and any Mitsuba XML made Lambertian."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from experiments.rendering import views
from experiments.rendering.lambertian import load_xml
from experiments.rendering.scene import build
from experiments.rendering.scenes import rooms
from experiments.rendering.scenes.catalogue import CALM, FAMILIES, OF_PICTURES, world_of
from experiments.rendering.scenes.world import World
from experiments.rendering.source import load
from experiments.rendering.tracer import Tracer


def _vertices(world: World) -> np.ndarray:
    return np.concatenate([s.mesh.vertices for s in world.surfaces])


@pytest.mark.parametrize("family", FAMILIES | OF_PICTURES)
def test_a_family_is_a_function_of_its_seed(family: str) -> None:
    world, again, other = (world_of(f"{family}-{seed}") for seed in (5, 5, 6))
    np.testing.assert_array_equal(_vertices(world), _vertices(again))
    assert _vertices(world).shape != _vertices(other).shape or not np.allclose(
        _vertices(world), _vertices(other)
    )
    assert world.view or (world.lookouts and world.sights)
    for surface in world.surfaces:
        mesh, texture = surface.mesh, surface.material.texture
        assert np.isfinite(mesh.vertices).all() and mesh.faces.max() < len(mesh.vertices)
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
        assert texture.min() >= 0 and texture.max() <= 0.95


def test_later_scenes_have_weaker_colours_of_the_same_brightness() -> None:
    strong, calm = rooms.furnished(CALM + 1), world_of(f"furnished-{CALM + 1}")
    np.testing.assert_array_equal(_vertices(strong), _vertices(calm))
    textures = [[s.material.texture for s in world.surfaces] for world in (strong, calm)]
    for before, after in zip(*textures, strict=True):
        np.testing.assert_allclose(after.mean(-1), before.mean(-1), atol=1e-6)
    colour = [np.mean([t.std(-1).mean() for t in world]) for world in textures]
    assert colour[1] < 0.8 * colour[0]


def test_an_unknown_scene_is_named() -> None:
    with pytest.raises(ValueError, match="there is no scene 'castle-1' of ours: use room"):
        load("castle-1")


@pytest.mark.parametrize("name", ["furnished-2", "terrain-2"])
def test_random_views_look_at_something_from_a_free_place(name: str) -> None:
    world = world_of(name)
    scene = build(world)
    candidates = views.of_world(world, np.random.default_rng(0))
    for camera in views.random_views(scene, candidates, world.ao_distance, 2):
        probe = Tracer.of(scene, camera, 64, 36)
        depth = probe.guides["depth"][probe.guides["mask"] > 0]
        assert np.quantile(depth, 0.05) >= 0.25 * world.ao_distance
        assert probe.guides["mask"].mean() >= 0.5


XML = """<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="45"/>
    <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="64"/>
      <integer name="height" value="36"/></film>
  </sensor>
  <bsdf type="roughconductor" id="metal">
    <rgb name="specular_reflectance" value="0.7 0.5 0.1"/></bsdf>
  <bsdf type="dielectric" id="pane"/>
  <bsdf type="twosided" id="coat"><bsdf type="plastic">
    <rgb name="diffuse_reflectance" value="0.1 0.2 0.6"/></bsdf></bsdf>
  <shape type="sphere" id="a"><point name="center" x="-1" y="0" z="0"/>
    <float name="radius" value="0.6"/><ref id="metal"/></shape>
  <shape type="sphere" id="b"><point name="center" x="1" y="0" z="0"/>
    <float name="radius" value="0.6"/><ref id="coat"/></shape>
  <shape type="sphere" id="c"><float name="radius" value="0.3"/><ref id="pane"/></shape>
  <shape type="sphere" id="d"><float name="radius" value="0.2"/>
    <bsdf type="thindielectric"/></shape>
  <emitter type="constant"><rgb name="radiance" value="1 1 1"/></emitter>
</scene>"""


def test_any_xml_becomes_lambertian_without_glass(tmp_path: Path) -> None:
    path = tmp_path / "balls.xml"
    path.write_text(XML)
    scene, camera = load_xml(path)
    assert sorted(shape.id() for shape in scene.shapes()) == ["a", "b"]
    assert camera.fov_x == pytest.approx(45)
    guides = Tracer.of(scene, camera, 64, 36).guides
    colours = np.unique(np.round(guides["albedo"][guides["mask"][..., 0] > 0], 3), axis=0)
    np.testing.assert_allclose(colours, [[0.1, 0.2, 0.6], [0.7, 0.5, 0.1]])
    for shape in scene.shapes():
        assert mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.DiffuseReflection)


def test_a_broken_xml_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "broken.xml"
    path.write_text("<scene version='3.0.0'><shape type='sphere'>")
    with pytest.raises(ValueError, match="Mitsuba cannot load"):
        load_xml(path)
    path.write_text("<scene version='3.0.0'><shape type='sphere'/></scene>")
    with pytest.raises(ValueError, match="has no camera"):
        load_xml(path)
