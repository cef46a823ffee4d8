"""Denoise what Cycles renders with jflnr: a panel in the render properties (docs/blender.md).

jflnr runs as a process of its own, installed with any Python; the preferences say where it is.
"""

import subprocess
import tempfile
from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

PASSES = ("normal", "z", "position", "emit", "environment", "vector")
METHODS = [
    ("picture", "Fast", "The whole picture, fitted to what the first hit shows"),
    ("flnr-picture", "Network", "The same, corrected by a small network"),
]


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    command: StringProperty(
        name="Command", default="jflnr", description="Name or path of the command jflnr"
    )

    def draw(self, context):
        self.layout.prop(self, "command")


class Operator:
    """What the operators share: a failure of the command is told in the status bar."""

    @classmethod
    def poll(cls, context):
        return context.engine == "CYCLES"

    def execute(self, context):
        try:
            self.work(context)
        except FileNotFoundError:
            self.report({"ERROR"}, "jflnr is not found: name it in the extension's preferences")
        except subprocess.CalledProcessError as error:
            self.report({"ERROR"}, error.stderr.strip() or "jflnr failed")
        else:
            return {"FINISHED"}
        return {"CANCELLED"}


class RENDER_OT_jflnr(Operator, bpy.types.Operator):
    """Render the frame with Cycles, denoise it, and show it in the image editors"""

    bl_idname = "render.jflnr"
    bl_label = "Denoise with jflnr"

    def work(self, context):
        folder = Path(bpy.app.tempdir or tempfile.mkdtemp())
        noisy, clean = folder / "jflnr-noisy.exr", folder / "jflnr-clean.exr"
        wanted = [*passes(context), (context.scene.render, "filepath", str(noisy))]
        before = [(owner, name, getattr(owner, name)) for owner, name, _ in wanted]
        try:
            put(wanted)
            bpy.ops.render.render(write_still=True)
        finally:
            put(before)
        denoise(context, noisy, clean, "--overwrite")
        show(context, clean)


class RENDER_OT_jflnr_passes(Operator, bpy.types.Operator):
    """Have Cycles write the passes that jflnr reads, as multilayer EXR"""

    bl_idname = "render.jflnr_passes"
    bl_label = "Write passes for jflnr"

    def work(self, context):
        put(passes(context))


class RENDER_OT_jflnr_animation(Operator, bpy.types.Operator):
    """Denoise the frames in the output folder, each with those before it, into its folder jflnr"""

    bl_idname = "render.jflnr_animation"
    bl_label = "Denoise rendered frames"

    def work(self, context):
        folder = Path(bpy.path.abspath(context.scene.render.frame_path())).parent
        denoise(context, folder, folder / "jflnr", "--temporal")
        show(context, min((folder / "jflnr").glob("*.exr"))).source = "SEQUENCE"


class RENDER_PT_jflnr(bpy.types.Panel):
    bl_label = "jflnr"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = frozenset({"DEFAULT_CLOSED"})

    @classmethod
    def poll(cls, context):
        return context.engine == "CYCLES"

    def draw(self, context):
        self.layout.prop(context.scene, "jflnr_method")
        self.layout.operator("render.jflnr", icon="RENDER_STILL")
        self.layout.operator("render.jflnr_passes")
        self.layout.operator("render.jflnr_animation", icon="RENDER_ANIMATION")


def passes(context):
    """What has to be set for the scene to write them: owner, name and value each."""
    scene, layer = context.scene, context.view_layer
    image = scene.render.image_settings
    wanted = [
        (scene.cycles, "use_denoising", False),
        (layer.cycles, "denoising_store_passes", True),
    ]
    wanted += [(layer, f"use_pass_{name}", True) for name in PASSES]
    if hasattr(image, "media_type"):  # Blender 5.0 and later
        wanted += [(image, "media_type", "MULTI_LAYER_IMAGE")]
    return [*wanted, (image, "file_format", "OPEN_EXR_MULTILAYER"), (image, "color_depth", "32")]


def put(wanted):
    for owner, name, value in wanted:
        setattr(owner, name, value)


def denoise(context, source, target, *options):
    """Run the command, from a file to a file or from a folder to a folder."""
    command = context.preferences.addons[__package__].preferences.command
    words = [command, "denoise", source, "-o", target, "--method", context.scene.jflnr_method]
    words += ["--channels", "picture", "--quiet", *options]
    subprocess.run(list(map(str, words)), check=True, stderr=subprocess.PIPE, text=True)


def show(context, path):
    """Load the picture, in the place of the last one, and put it into every image editor."""
    if before := bpy.data.images.get("jflnr"):
        bpy.data.images.remove(before)
    image = bpy.data.images.load(str(path), check_existing=False)
    image.name = "jflnr"
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.spaces.active.image = image
    return image


CLASSES = (
    Preferences, RENDER_OT_jflnr, RENDER_OT_jflnr_passes, RENDER_OT_jflnr_animation, RENDER_PT_jflnr
)  # fmt: skip


def register():
    bpy.types.Scene.jflnr_method = EnumProperty(name="Method", items=METHODS)
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
    del bpy.types.Scene.jflnr_method
