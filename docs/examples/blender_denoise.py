"""Render the open scene with Cycles, denoise it with jflnr, and show the result, in one go.

In Blender: open this file in the text editor and press Run Script, or

    blender scene.blend --python docs/examples/blender_denoise.py

Needs the command `jflnr`, installed with any Python (`pip install jflnr`); where Blender does not
find it, the environment variable JFLNR says where it is. The scene's own settings are put back.
"""

import os
import subprocess
import tempfile
from pathlib import Path

import bpy

JFLNR = os.environ.get("JFLNR", "jflnr")
OPTIONS = ["--channels", "picture"]
PASSES = ("normal", "z", "position", "emit", "environment")


def main() -> bpy.types.Image:
    """Render, denoise and show; returns the denoised picture as an image of Blender's."""
    folder = Path(bpy.app.tempdir or tempfile.mkdtemp())
    noisy, clean = folder / "jflnr-noisy.exr", folder / "jflnr-clean.exr"
    render(bpy.context.scene, bpy.context.view_layer, noisy)
    command = [JFLNR, "denoise", str(noisy), "-o", str(clean), "--overwrite", *OPTIONS]
    subprocess.run(command, check=True)
    return show(clean)


def render(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, path: Path) -> None:
    """Write the passes that jflnr reads as a multilayer EXR at `path`."""
    image, passes = scene.render.image_settings, [f"use_pass_{name}" for name in PASSES]
    wanted = [(scene.render, "engine", "CYCLES"), (scene.render, "filepath", str(path))]
    wanted += [(scene.cycles, "use_denoising", False)]
    wanted += [(view_layer.cycles, "denoising_store_passes", True)]
    wanted += [(view_layer, name, True) for name in passes]
    if hasattr(image, "media_type"):  # Blender 5.0 and later
        wanted += [(image, "media_type", "MULTI_LAYER_IMAGE")]
    wanted += [(image, "file_format", "OPEN_EXR_MULTILAYER"), (image, "color_depth", "32")]
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in wanted]
    try:
        for owner, name, value in wanted:
            setattr(owner, name, value)
        bpy.ops.render.render(write_still=True)
    finally:
        for owner, name, value in before:
            setattr(owner, name, value)


def show(path: Path) -> bpy.types.Image:
    """Load the picture, and put it into every open image editor."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.name = "jflnr"
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.spaces.active.image = image
    return image


if __name__ == "__main__":
    main()
