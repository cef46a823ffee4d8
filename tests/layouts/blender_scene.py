"""Run by Blender's Python: render a small scene as multilayer EXR.

    python blender_scene.py OUT WIDTH HEIGHT SAMPLES PASSES [ZIP COMMAND]

PASSES is `all`, `denoising` (only what `Denoising Data` gives), `denoised` (both, with Blender's
own denoiser on) or `moving` (all, and the cube has come from 0.4 to the left and 0.1 below).
With ZIP, that extension is installed instead, with its COMMAND, and run on the scene: the folder
OUT then holds what it rendered, `noisy.exr`, what it showed of that, `shown.npy`, and two frames of
an animation, `frames/`.
"""

import shutil
import sys
from math import pi
from pathlib import Path

import bpy
import numpy as np

LIGHT = [
    f"{kind}_{part}"
    for kind in ("diffuse", "glossy", "transmission")
    for part in ("direct", "indirect", "color")
]
PASSES = [*LIGHT, "vector", "emit", "environment", "ambient_occlusion", "normal", "z", "position"]


def material(colour, metallic=0.0, glow=0.0):
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*colour, 1)
    inputs["Metallic"].default_value = metallic
    inputs["Roughness"].default_value = 0.1 if metallic else 0.9
    inputs["Emission Color"].default_value = (1, 1, 1, 1)
    inputs["Emission Strength"].default_value = glow
    return made


def put(shape, made, **where):
    getattr(bpy.ops.mesh, f"primitive_{shape}_add")(**where)
    bpy.context.object.data.materials.append(made)


def build(width, height, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    put("plane", material((0.8, 0.8, 0.8)), size=10)
    put("plane", material((0.8, 0.1, 0.1)), size=4, location=(0, 4, 0), rotation=(pi / 2, 0, 0))
    put("cube", material((0.1, 0.6, 0.2)), location=(-1.2, 0, 1))
    put("uv_sphere", material((0.9, 0.9, 0.9), metallic=1.0), location=(1.2, 1, 1))
    put("uv_sphere", material((0, 0, 0), glow=5.0), location=(2.2, -0.5, 0.4), radius=0.4)
    bpy.ops.object.light_add(type="AREA", location=(3, -3, 5), rotation=(0.7, 0.4, 0.8))
    bpy.context.object.data.energy = 400
    bpy.ops.object.camera_add(location=(0, -7, 2.5), rotation=(1.35, 0, 0))
    scene.camera = bpy.context.object
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_denoising = samples, False
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    return scene


def write(scene, path, passes):
    layer, image = scene.view_layers[0], scene.render.image_settings
    for name in PASSES if passes != "denoising" else ():
        setattr(layer, f"use_pass_{name}", True)
    if passes == "moving":
        move(scene, bpy.data.objects["Cube"])
    layer.cycles.denoising_store_passes = passes.startswith("denois")
    scene.cycles.use_denoising = passes == "denoised"
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def move(scene, cube):
    here = cube.location.copy()
    for frame, (x, z) in enumerate(((-0.4, -0.1), (0, 0), (1, 1)), start=1):
        cube.location = here.x + x, here.y, here.z + z
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(2)


def extend(scene, out, zip, command):
    install = bpy.ops.extensions.package_install_files
    install(filepath=zip, repo="user_default", enable_on_install=True)
    bpy.context.preferences.addons["bl_ext.user_default.jflnr"].preferences.command = command
    assert bpy.types.RENDER_PT_jflnr.poll(bpy.context)
    image = scene.render.image_settings
    before = scene.render.filepath, image.file_format, scene.view_layers[0].use_pass_position
    assert bpy.ops.render.jflnr() == {"FINISHED"}
    assert before == (
        scene.render.filepath, image.file_format, scene.view_layers[0].use_pass_position
    )  # fmt: skip
    shutil.copy(Path(bpy.app.tempdir, "jflnr-noisy.exr"), out / "noisy.exr")
    shown = bpy.data.images["jflnr"]
    width, height = shown.size
    np.save(out / "shown.npy", np.reshape(shown.pixels, (height, width, -1))[::-1, :, :3])

    move(scene, bpy.data.objects["Cube"])
    scene.render.filepath, scene.frame_end = f"{out}/frames/f_", 2
    bpy.ops.render.jflnr_passes()
    bpy.ops.render.render(animation=True)
    assert bpy.ops.render.jflnr_animation() == {"FINISHED"}
    assert bpy.data.images["jflnr"].source == "SEQUENCE"
    bpy.context.preferences.addons["bl_ext.user_default.jflnr"].preferences.command = "nowhere"
    try:
        bpy.ops.render.jflnr()
    except RuntimeError as error:
        assert "jflnr is not found" in str(error)


def main(path, width, height, samples, passes, *extension):
    scene = build(int(width), int(height), int(samples))
    if not extension:
        return write(scene, path, passes)
    return extend(scene, Path(path), *extension)


if __name__ == "__main__":
    main(*sys.argv[1:])
