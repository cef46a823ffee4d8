"""Scenes for whole pictures, rendered by Blender's Cycles, which nothing is fitted on.

    python experiments/rendering/blender.py SCENE... --out cache/pictures
    python experiments/rendering/blender.py room --shot --out cache/shots

needs Python 3.11 with `bpy==4.5.*` and `OpenEXR`, in an environment of their own. Per scene it
writes `1spp.exr`, `4spp.exr` and `16spp.exr` as Blender does, and `reference.exr` from two
independent halves. Everything is
made of Blender's primitives; settings are its defaults, except that nothing is denoised. A shot has
`000.exr`, ... of 4 samples, and `references/008.exr`, ... of every second frame from then on.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from math import radians
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenEXR
from mathutils import Vector

SIZE = 320, 180
SAMPLES = 1, 4, 16
HALF_SPP = 128
# A shot: its frames, those with a reference, and samples of half of one.
FRAMES, REFERENCED, SHOT_HALF_SPP = 20, range(8, 20, 2), 64
PASSES = (
    *("z", "normal", "position", "emit", "environment"),
    *(f"{lobe}_{part}" for lobe in ("diffuse", "glossy", "transmission")
      for part in ("direct", "indirect", "color")),
)  # fmt: skip
GOLD: dict[str, Any] = {"Metallic": 1.0, "Roughness": 0.25, "Base Color": (1, 0.72, 0.3, 1)}
CHROME: dict[str, Any] = {"Metallic": 1.0, "Roughness": 0.03, "Base Color": (0.95, 0.95, 0.95, 1)}
GLASS: dict[str, Any] = {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}
PAINT: dict[str, Any] = {"Base Color": (0.6, 0.03, 0.02, 1), "Roughness": 0.35, "Coat Weight": 1.0}
PLASTER: dict[str, Any] = {"Base Color": (0.75, 0.74, 0.7, 1), "Roughness": 0.9}


def material(checks: float = 0, **inputs: Any) -> Any:
    """A principled material; with `checks`, a checkerboard of that scale as its colour."""
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    nodes, surface = made.node_tree.nodes, made.node_tree.nodes["Principled BSDF"]
    for name, value in inputs.items():
        surface.inputs[name].default_value = value
    if checks:
        texture = nodes.new("ShaderNodeTexChecker")
        texture.inputs["Scale"].default_value = checks
        texture.inputs[1].default_value = (0.6, 0.55, 0.5, 1)
        texture.inputs[2].default_value = (0.1, 0.14, 0.2, 1)
        made.node_tree.links.new(texture.outputs[0], surface.inputs["Base Color"])
    return made


def put(primitive: Callable[..., Any], made: Any, smooth: bool = True, **where: Any) -> Any:
    """Add one of Blender's primitives with a material."""
    primitive(**where)
    thing = bpy.context.object
    thing.data.materials.append(made)
    thing.data.polygons.foreach_set("use_smooth", [smooth] * len(thing.data.polygons))
    return thing


def sphere(location: tuple, radius: float, **inputs: Any) -> Any:
    add = bpy.ops.mesh.primitive_uv_sphere_add
    where: dict[str, Any] = {"location": location, "radius": radius}
    where |= {"segments": 64, "ring_count": 32}
    return put(add, material(**inputs), **where)


def monkey(location: tuple, turn: float, **inputs: Any) -> Any:
    where: dict[str, Any] = {"location": location, "rotation": (radians(-20), 0, radians(turn))}
    thing = put(bpy.ops.mesh.primitive_monkey_add, material(**inputs), size=1, **where)
    thing.modifiers.new("smooth", "SUBSURF").render_levels = 2
    return thing


def place(made: Any, location: tuple, towards: tuple) -> Any:
    """Put a camera or a lamp into the scene, looking at a point."""
    thing = bpy.data.objects.new("thing", made)
    bpy.context.scene.collection.objects.link(thing)
    thing.location = location
    turn = (Vector(towards) - Vector(location)).to_track_quat("-Z", "Y")
    thing.rotation_euler = turn.to_euler()
    return thing


def lamp(location: tuple, towards: tuple, size: float, power: float) -> None:
    made = bpy.data.lights.new("area", "AREA")
    made.energy, made.size = power, size
    place(made, location, towards)


def camera(location: tuple, towards: tuple, lens: float) -> None:
    made = bpy.data.cameras.new("camera")
    made.lens = lens
    bpy.context.scene.camera = place(made, location, towards)


def sky(colour: tuple, strength: float) -> None:
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (*colour, 1)
    background.inputs[1].default_value = strength


def moving(thing: Any, by: tuple, turn: float) -> None:
    """Motion by so much, and so many degrees about the vertical axis, while the shutter is open."""
    for frame, sign in ((0, -1), (2, 1)):
        thing.location = thing.location + sign * Vector(by)
        thing.rotation_euler[2] += sign * radians(turn)
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)
        thing.location = thing.location - sign * Vector(by)
        thing.rotation_euler[2] -= sign * radians(turn)


def blurred() -> None:
    """Things in motion in a closed room: motion blur, an emissive ceiling, gloss and glass."""
    wall: dict[str, Any] = {"size": 1, "scale": (8, 8, 0.1)}
    cube = bpy.ops.mesh.primitive_cube_add
    put(cube, material(checks=12, Roughness=0.3), False, location=(0, 0, -0.05), **wall)
    put(cube, material(**PLASTER), False, location=(0, 0, 3.55), **wall)
    for x, colour in ((-3.5, (0.6, 0.2, 0.15, 1)), (3.5, (0.2, 0.35, 0.55, 1))):
        side: dict[str, Any] = {"location": (x, 0, 1.75), "rotation": (0, radians(90), 0)}
        put(cube, material(**PLASTER | {"Base Color": colour}), False, **side, **wall)
    back: dict[str, Any] = {"location": (0, 3.5, 1.75), "rotation": (radians(90), 0, 0)}
    put(cube, material(**PLASTER), False, **back, **wall)
    lit: dict[str, Any] = {"Emission Color": (1, 0.85, 0.65, 1), "Emission Strength": 9.0}
    glow = material(**lit)
    put(cube, glow, False, size=1, scale=(1.6, 0.4, 0.02), location=(0, 1, 3.48))
    moving(sphere((-1.6, 0.4, 1.7), 0.4, **PAINT), (0.35, 0, 0.1), 0)
    moving(monkey((0.1, 0.3, 0.75), 0, **GOLD), (0, 0, 0), 25)
    moving(
        put(cube, material(checks=6), False, size=0.7, location=(1.8, 1.2, 0.8)), (0, 0, 0.15), 20
    )
    sphere((-1.1, -1.2, 0.35), 0.35, **GLASS)
    sphere((1.2, -1.0, 0.3), 0.3, **CHROME)
    sky((0, 0, 0), 0)
    camera((0.2, -5.6, 1.7), (0, 0, 1.2), 30)
    bpy.context.scene.render.use_motion_blur = True


def cutout() -> None:
    """Things on a transparent film: thin wires, glass, a shadow catcher of no kind, no floor."""
    monkey((-1.2, 0, 0.1), -20, **PAINT)
    monkey((0.2, 0.7, 0.2), 10, **GOLD)
    sphere((1.4, 0, 0), 0.6, **GLASS)
    sphere((0.25, -0.9, -0.45), 0.3, **CHROME)
    lit: dict[str, Any] = {"Emission Color": (0.3, 0.6, 1, 1), "Emission Strength": 4.0}
    sphere((1.1, -1.0, -0.5), 0.2, **lit)
    for i in range(24):
        wire: dict[str, Any] = {"radius": 0.006, "depth": 3, "location": (-2.4 + 0.2 * i, 1.6, 0)}
        turn = (radians(4 * (i % 5) - 8), radians(3 * i - 36), 0)
        put(bpy.ops.mesh.primitive_cylinder_add, material(**PLASTER), rotation=turn, **wire)
    lamp((-3, -3, 3), (0, 0, 0), 1.5, 300)
    lamp((3, -1, 2), (0, 0, 0), 0.5, 80)
    sky((0.5, 0.65, 1), 0.3)
    camera((0.1, -6, 0.6), (0.1, 0, 0), 45)
    bpy.context.scene.render.film_transparent = True


def room() -> None:
    """An interior: windows with bars, a lamp, a mirror, glass, gold, and fine textures."""
    cube = bpy.ops.mesh.primitive_cube_add

    def box(size: tuple, location: tuple, made: Any) -> None:
        put(cube, made, False, size=1, scale=size, location=location)

    box((7, 7, 0.1), (0, 0, -0.05), material(checks=40, Roughness=0.25))
    box((7, 7, 0.1), (0, 0, 2.85), material(**PLASTER))
    box((7, 0.1, 2.8), (0, 3, 1.4), material(**PLASTER | {"Base Color": (0.5, 0.55, 0.45, 1)}))
    box((0.1, 7, 2.8), (3, 0, 1.4), material(**PLASTER | {"Base Color": (0.6, 0.4, 0.3, 1)}))
    box((0.1, 7, 2.8), (-3, 0, 1.4), material(**PLASTER))
    day: dict[str, Any] = {"Emission Color": (0.75, 0.88, 1, 1), "Emission Strength": 7.0}
    bars = material(**PLASTER | {"Base Color": (0.2, 0.12, 0.07, 1)})
    for x in (-1.7, 0.1):
        box((1.3, 0.02, 1.4), (x, 2.94, 1.5), material(**day))
        for i in range(5):
            box((0.03, 0.04, 1.4), (x - 0.6 + 0.3 * i, 2.91, 1.5), bars)
            box((1.3, 0.04, 0.03), (x, 2.91, 0.85 + 0.33 * i), bars)
    box((0.03, 1.6, 1.3), (2.93, 0.8, 1.5), material(**CHROME))
    box((1.5, 0.8, 0.05), (0.3, 0.3, 0.7), material(checks=25, Roughness=0.15))
    for x, y in ((-0.4, 0), (1, 0), (-0.4, 0.65), (1, 0.65)):
        box((0.04, 0.04, 0.7), (x, y, 0.35), material(**CHROME))
    lit: dict[str, Any] = {"Emission Color": (1, 0.7, 0.4, 1), "Emission Strength": 25.0}
    sphere((2, 1.7, 1.6), 0.12, **lit)
    sphere((0, 0.2, 0.9), 0.17, **GLASS)
    sphere((0.75, 0.35, 0.85), 0.13, **GOLD)
    sphere((0.4, 0, 0.8), 0.08, **GLASS | {"Base Color": (0.3, 0.8, 0.4, 1), "Roughness": 0.2})
    monkey((-1.5, 0.6, 0.4), 30, **PAINT)
    for i in range(14):
        book = (0.05, 0.18, 0.22 + 0.02 * (i * 7 % 5))
        shade = (0.1 + 0.5 * (i * 3 % 7) / 7, 0.1 + 0.4 * (i * 5 % 7) / 7, 0.2, 1)
        cover: dict[str, Any] = {"Base Color": shade, "Roughness": 0.3}
        box(book, (1.2 + 0.055 * i, 2.7, 1 + book[2] / 2), material(**cover))
    box((1, 0.25, 0.03), (1.6, 2.75, 0.98), bars)
    sky((0, 0, 0), 0)
    camera((-0.6, -3, 1.5), (0.3, 1, 0.95), 26)


def meadow() -> None:
    """Blades of grass, thinner than a pixel, through a wide open lens; sky and small lamps."""
    add = bpy.ops.mesh.primitive_plane_add
    earth: dict[str, Any] = {"Base Color": (0.2, 0.13, 0.08, 1), "Roughness": 0.9}
    put(add, material(**earth), False, size=40)
    random = np.random.default_rng(5)
    root = random.uniform((-4, -3, 0), (4, 6, 0), (6000, 3))
    turn, lean = random.uniform(0, 2 * np.pi, 6000), random.normal(0, 0.06, (6000, 2))
    side = 0.012 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    tip = root + np.column_stack([lean, random.uniform(0.15, 0.5, 6000)])
    corners = np.stack([root - side, root + side, tip], axis=1).reshape(-1, 3)
    mesh = bpy.data.meshes.new("grass")
    mesh.from_pydata(corners.tolist(), [], np.arange(18000).reshape(-1, 3).tolist())
    blade: dict[str, Any] = {"Base Color": (0.18, 0.4, 0.06, 1), "Roughness": 0.4}
    mesh.materials.append(material(**blade))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("grass", mesh))
    monkey((-0.9, 0.4, 0.75), -15, **GLASS)
    monkey((0.9, 0.8, 0.75), 20, **GOLD | {"Base Color": (0.9, 0.5, 0.4, 1)})
    sphere((0.1, -0.5, 0.45), 0.25, **CHROME)
    put(
        bpy.ops.mesh.primitive_cube_add,
        material(checks=16),
        False,
        size=0.9,
        location=(2.3, 2, 0.5),
    )
    for i in range(10):
        shade = (1, 0.4 + 0.05 * i, 0.2 + 0.08 * i, 1)
        lit: dict[str, Any] = {"Emission Color": shade, "Emission Strength": 20.0}
        sphere((-2.2 + 0.5 * i, 2.8, 1.1 + 0.1 * (i % 3)), 0.05, **lit)
    lamp((-3, -2, 4), (0, 0, 0.4), 0.8, 300)
    sky((0.35, 0.5, 0.9), 0.5)
    camera((0.2, -4, 1.1), (0.1, 0, 0.65), 45)
    lens = bpy.context.scene.camera.data.dof
    lens.use_dof, lens.focus_distance, lens.aperture_fstop = True, 4.2, 1.4


SCENES = {"blurred": blurred, "cutout": cutout, "room": room, "meadow": meadow}


def settings() -> None:
    """Blender's defaults, with every pass that denoising can use."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.frame_set(1)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    for name in (*PASSES, "vector"):
        setattr(layer, f"use_pass_{name}", True)
    layer.cycles.denoising_store_passes = True
    images = scene.render.image_settings
    images.file_format, images.color_depth = "OPEN_EXR_MULTILAYER", "16"


def render(path: Path, spp: int, seed: int) -> None:
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = spp, seed
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def combined(path: Path) -> dict[str, np.ndarray]:
    """The channels R, G, B, A of a picture that was rendered."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return {c: np.asarray(channels[f"ViewLayer.Combined.{c}"].pixels, np.float32) for c in "RGBA"}


def reference(path: Path, spp: int = HALF_SPP) -> None:
    """Two halves of so many samples: their mean, and the first of them."""
    with tempfile.TemporaryDirectory() as folder:
        halves = [Path(folder) / f"{seed}.exr" for seed in (101, 202)]
        for half, seed in zip(halves, (101, 202), strict=True):
            render(half, spp, seed)
        first, second = map(combined, halves)
    channels = {f"reference.{c}": (first[c] + second[c]) / 2 for c in first}
    channels |= {f"reference_a.{c}": first[c] for c in first}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def shot(folder: Path) -> None:
    """The camera goes sideways, and the monkey along and about itself, evenly."""
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    scene = bpy.context.scene
    for thing, by, turn in ((scene.camera, 0.6, 0), (bpy.data.objects["Suzanne"], 0.5, 70)):
        for frame, share in ((-1, 0), (FRAMES, 1)):
            thing.keyframe_insert("location", frame=frame)
            thing.keyframe_insert("rotation_euler", frame=frame)
            thing.location.x += by * (1 - share)
            thing.rotation_euler[2] += radians(turn) * (1 - share)
    (folder / "references").mkdir(parents=True, exist_ok=True)
    for frame in range(FRAMES):
        scene.frame_set(frame)
        render(folder / f"{frame:03}.exr", 4, frame)
        if frame in REFERENCED:
            reference(folder / "references" / f"{frame:03}.exr", SHOT_HALF_SPP)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", choices=SCENES)
    parser.add_argument("--out", type=Path, default=Path("cache/pictures"))
    parser.add_argument("--shot", action="store_true", help="frames in motion in place of pictures")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        SCENES[name]()
        settings()
        folder = (arguments.out / name).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        if arguments.shot:
            shot(folder)
            continue
        for spp in SAMPLES:
            render(folder / f"{spp}spp.exr", spp, spp)
        reference(folder / "reference.exr")


if __name__ == "__main__":
    main()
