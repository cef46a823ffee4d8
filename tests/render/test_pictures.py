"""Whole pictures: materials in a furnace, auxiliary layers, the filter, the lens, the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.signal.windows import blackmanharris

from experiments.rendering import frame, materials, pictures
from experiments.rendering.camera import looking
from experiments.rendering.picture import FILTER, Film, Lens, Shading, filter_offsets
from experiments.rendering.scene import build
from experiments.rendering.scenes import finishes
from experiments.rendering.scenes.catalogue import FAMILIES, OF_PICTURES, world_of
from experiments.rendering.scenes.geometry import quad, sphere
from experiments.rendering.scenes.props import KINDS, Seen
from experiments.rendering.scenes.world import Ball, Finish, Material, Surface, World, plain
from experiments.rendering.source import load
from jflnr import read_frame
from jflnr.camera import Camera
from jflnr.methods import default_of

WHITE = [
    Finish(),
    Finish("principled", 0.1, metallic=1.0),
    Finish("metal", 0.0),
    Finish("metal", 0.1),
    Finish("glass", 0.0),
    Finish("glass", 0.1),
    Finish("pane", 0.0),
    Finish("plastic"),
]


def _film(surfaces: list[Surface], camera: Camera, width: int, sky: float, **options: Any) -> Film:
    """A picture of some surfaces under an even sky."""
    world = World(1.0, surfaces, environment=np.full((8, 16, 3), sky, np.float32))
    finishes = {f"mesh{i:04}": s.material.finish for i, s in enumerate(surfaces)}
    scene = build(world, by_power=True)
    return Film(scene, camera, width, width // 2, Shading.of(scene, finishes), **options)


def _textured(colour: float, finish: Finish) -> Material:
    return Material(np.full((2, 2, 3), colour, np.float32), 1.0, finish)


@pytest.fixture(scope="module")
def furnace() -> dict[str, np.ndarray]:
    """A row of white balls under a white sky, each in its own part of the width."""
    balls = [
        Surface(sphere(0.6, 48).moved([2.0 * i, 0, 0]), _textured(1.0, finish))
        for i, finish in enumerate(WHITE)
    ]
    middle = len(WHITE) - 1
    camera = looking(
        [middle, 0, 400.0], [middle, 0, 0], np.degrees(2 * np.arctan(len(WHITE) / 400))
    )
    return _film(balls, camera, 16 * len(WHITE), 1.0).sample(64, 1)


@pytest.mark.parametrize("number", range(len(WHITE)), ids=[f"{f.kind}-{f.alpha}" for f in WHITE])
def test_white_is_invisible_in_a_white_furnace(furnace: dict[str, np.ndarray], number: int) -> None:
    """But for what Mitsuba's rough surfaces would scatter twice, at both ends of rough glass."""
    lost = 0.06 if WHITE[number] == Finish("glass", 0.1) else 0.03
    ball = furnace["beauty"][26:38, 16 * number + 2 : 16 * number + 14]
    assert abs(ball.mean() - 1) < lost


def test_what_is_seen_directly_adds_up(furnace: dict[str, np.ndarray]) -> None:
    sky = furnace["environment"][0]
    np.testing.assert_allclose(sky, 1, atol=1e-3)
    np.testing.assert_allclose(furnace["seen_albedo"][0], sky, atol=1e-3)
    assert (furnace["emission"] == 0).all() and (furnace["alpha"] == 1).all()


@pytest.mark.parametrize(
    "finish", [Finish("metal", 0.0, tint=(0.9, 0.8, 0.7)), Finish("pane", 0.0)]
)
def test_auxiliaries_follow_mirrors_and_glass(finish: Finish) -> None:
    """A mirror on the ground before a wall shows the wall; a pane before it lets it through."""
    wall = Surface(quad([-9, -9, -3], [18, 0, 0], [0, 18, 0]), _textured(0.4, Finish()))
    if finish.kind == "metal":
        flat = quad([-9, 0, 9], [18, 0, 0], [0, 0, -11.9])
        camera, normal = looking([0, 2, 2], [0, 0, -0.5], 20.0), [0, 1, 0]
    else:
        flat = quad([-9, -9, 0], [18, 0, 0], [0, 18, 0])
        camera, normal = looking([0, 2, 5], [0, 2, 0], 20.0), [0, 0, 1]
    surfaces = [wall, Surface(flat, Material(plain([1, 1, 1]).texture, finish=finish))]
    images = _film(surfaces, camera, 16, 0.0).sample(64, 3)
    # A pane, too, reflects a little of what is black here.
    share = 1.0 if finish.kind == "metal" else images["seen_normal"][..., 2].mean()
    assert share > 0.85
    np.testing.assert_allclose(images["normal"].mean((0, 1)), normal, atol=1e-3)
    np.testing.assert_allclose(images["seen_normal"].mean((0, 1)), [0, 0, share], atol=1e-3)
    expected = 0.4 * share * np.array(finish.tint)
    np.testing.assert_allclose(images["seen_albedo"].mean((0, 1)), expected, rtol=0.03)


def test_rough_metal_is_seen_itself() -> None:
    wall = Surface(quad([-9, -9, 0], [18, 0, 0], [0, 18, 0]), _textured(0.4, Finish()))
    tint = (0.9, 0.6, 0.3)
    metal = Material(plain([1, 1, 1]).texture, finish=Finish("metal", 0.3, tint=tint))
    ball = Surface(sphere(3.0, 32), metal)
    images = _film([wall, ball], looking([0, 0, 9], [0, 0, 0], 2.0), 16, 1.0).sample(4, 1)
    np.testing.assert_allclose(images["seen_albedo"].mean((0, 1)), tint, rtol=0.02)
    assert images["seen_normal"][..., 2].min() > 0.9


def test_samples_are_drawn_with_the_density_of_the_filter() -> None:
    """Against scipy's window, by its cumulative sum."""
    offsets = filter_offsets()
    window = blackmanharris(20001)
    x = np.linspace(-FILTER, FILTER, 20001)
    cumulative = np.cumsum(window) / window.sum()
    shares = np.linspace(0, 1, len(offsets))
    np.testing.assert_allclose(np.interp(offsets[5:-5], x, cumulative), shares[5:-5], atol=1e-4)
    np.testing.assert_allclose(offsets, -offsets[::-1], atol=1e-3)


def test_a_lens_is_sharp_at_its_focus() -> None:
    camera = looking([1, 2, 3], [0, 0.5, -4], 50.0)
    shoot = _film([], camera, 16, 1.0, lens=Lens(0.3, 2.5))._camera_rays(dr.arange(mi.UInt32, 128))
    middle = mi.Point2f(0.5, 0.5)
    ends = []
    for aperture in ((0.5, 0.5), (0.0, 0.3), (0.9, 0.99)):
        ray = shoot(middle, mi.Point2f(*aperture))
        origin, way = np.array(ray.o).T - camera.to_world[:3, 3], np.array(ray.d).T
        forward = camera.to_world[:3, 2]
        assert np.abs(origin @ forward).max() < 1e-5
        ends.append(origin + way * (2.5 / (way @ forward))[:, None])
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-4)
    np.testing.assert_allclose(ends[2], ends[0], atol=1e-4)


def test_streams_are_functions_of_their_seeds_and_independent(room: Any) -> None:
    film = Film(room.scene, room.own[0], 64, 36, Shading.of(room.scene, {}), exposure=0.1)
    a, b, c, d = (film.sample(4, seed)["beauty"].mean(-1).ravel() for seed in range(4))
    np.testing.assert_array_equal(film.sample(4, 2)["beauty"].mean(-1).ravel(), c)
    noise = [np.clip(x - y, -1, 1) for x, y in ((a, b), (c, d))]
    assert abs(np.corrcoef(*noise)[0, 1]) < 4 / len(a) ** 0.5


def test_a_picture_is_read_as_other_programs_pictures_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "NOISY", (1, 1, 4))
    source = load("forms-3")
    found = source.view(100)
    assert found is not None
    layers, facts = pictures.render(source, found[0], 5, 48, 32, half=4)
    again, _ = pictures.render(source, found[0], 5, 48, 32, half=4)
    for name, image in layers.items():
        np.testing.assert_array_equal(image, again[name], err_msg=name)
    assert not np.array_equal(layers["beauty_1"], layers["beauty_1_b"])
    path = tmp_path / "picture.exr"
    frame.write(path, layers, facts)
    for spp in (1, 4):
        read = read_frame(path, spp)
        assert np.all(read.samples == spp) and default_of(read) == "picture"
        assert read.beauty is not None and read.seen_albedo is not None
        np.testing.assert_allclose(read.beauty, layers[f"beauty_{spp}"], rtol=2e-3, atol=1e-6)
        np.testing.assert_allclose(
            read.seen_albedo, layers[f"seen_albedo_{spp}"], rtol=2e-3, atol=1e-6
        )


def test_a_scene_file_gets_materials_too() -> None:
    source = load("experiments/rendering/scenes/simple/cornell-box.xml")
    assert source.path is not None
    scene, found = materials._file(source.path, np.random.default_rng(2))
    assert {shape.id() for shape in scene.shapes()} == set(found)
    assert len({finish.kind for finish in found.values()}) > 1


@pytest.mark.parametrize("kind", [kind for kind, _ in KINDS], ids=lambda kind: kind.__name__[1:])
def test_things_are_sound_and_of_the_size_of_what_is_seen(kind: Any) -> None:
    rng = np.random.default_rng(4)
    way = np.array([[0, 1, 0], [0, 0, 1.0], [1, 0, 0]], np.float32)
    seen = Seen(looking([0, 1, 5], [0, 1, 0], 60.0), rng.normal(size=(3, 3)).astype("f4"), way,
                np.array([4, 5, 6], np.float32))  # fmt: skip
    for _ in range(6):
        for thing in kind(rng, seen):
            if isinstance(thing, Ball):
                assert 0 < thing.radius < 0.5 and min(thing.radiance) > 0
                continue
            mesh = thing.mesh
            assert np.isfinite(mesh.vertices).all() and mesh.faces.max() < len(mesh.vertices)
            assert np.abs(mesh.vertices).max() < 20
            np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)


@pytest.mark.parametrize("family", FAMILIES | OF_PICTURES)
def test_surfaces_of_a_family_get_finishes_by_seed(family: str) -> None:
    world = world_of(f"{family}-7")
    made, again = (finishes.dressed(world, np.random.default_rng(1)) for _ in range(2))
    kinds = [surface.material.finish for surface in made.surfaces]
    assert kinds == [surface.material.finish for surface in again.surfaces]
    assert len({finish.kind for finish in kinds}) > 1
    for before, after in zip(world.surfaces, made.surfaces, strict=True):
        assert after.mesh is before.mesh and after.radiance == before.radiance
