"""What Blender's Cycles writes as OpenEXR MultiLayer: `<view layer>.<pass>.<component>`.

Facts taken from files that Blender 4.5 and 5.0 wrote (tests/layouts/test_blender.py): the light
passes are divided by the pass `Diffuse Color`, all passes together sum to `Combined`, the depth is
measured along the view axis and 1e10 where nothing is hit, and normals face the camera.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from jflnr.exr import layers_of
from jflnr.layouts.channels import Layout, in_layer

# Names since Blender 5.0, then those up to 4.x. `Noisy Image` is the picture before Blender's own
# denoiser, which `Combined` is after.
BEAUTY = ("Noisy Image", "Combined")
PASSES = {
    "indirect": ("Diffuse Indirect", "DiffInd"),
    "direct": ("Diffuse Direct", "DiffDir"),
    "albedo": ("Diffuse Color", "DiffCol"),
}
WHOLE_PICTURE = {
    "albedo": ("Denoising Albedo", *PASSES["albedo"]),
    "emission": ("Emission", "Emit"),
}
GUIDES = {
    "normal": ("Normal", "Denoising Normal"),
    "depth": ("Depth", "Denoising Depth"),
    "position": ("Position",),
}
AO = ("Ambient Occlusion", "AO")

ADVICE = {
    "albedo": "switch on Diffuse Color under View Layer > Passes > Light, or Denoising Data",
    "normal": "switch on Normal under View Layer > Passes > Data",
    "depth": "switch on Z under View Layer > Passes > Data",
}
WHOLE_NOTE = (
    "there is no pass Diffuse Indirect with Diffuse Color, so the whole picture is divided by "
    "{} and denoised; with both passes, only diffuse indirect light would be"
)
NOISY_AO = (
    "the ambient occlusion pass is left out: Cycles traces one ray for it per sample, which makes "
    "it as noisy as the light (with enough samples, take it by --map ao={})"
)


def layout(channels: Mapping[str, np.ndarray]) -> Layout | None:
    """The first view layer that can be denoised, or None if this is no file of Blender's."""
    views = _views(channels)
    if not views:
        return None
    view = max(views, key=lambda view: _usefulness(views[view]))
    passes = views[view]
    light = _find(passes, PASSES)
    notes = []
    if "indirect" not in light or "albedo" not in light:
        light = _find(passes, WHOLE_PICTURE)
        notes.append(WHOLE_NOTE.format(light.get("albedo", "albedo")))
    if ao := _find(passes, {"ao": AO}).get("ao"):
        notes.append(NOISY_AO.format(_layer(view, ao)))
    if len(views) > 1:
        others = ", ".join(sorted(set(views) - {view}))
        notes.append(f"view layer {view} is used; the file also holds {others}")
    wanted = {"albedo": "Diffuse Color", "normal": "Normal", "depth": "Depth"}
    chosen = wanted | light | _find(passes, GUIDES | {"beauty": BEAUTY})
    names = {layer: in_layer(channels, _layer(view, name)) for layer, name in chosen.items()}
    missing = {layer: (f"{_layer(view, wanted[layer])}.R",) for layer in names if not names[layer]}
    combined = _layer(view, "Combined")
    alpha = f"{combined}.A"
    picture = in_layer(channels, combined) + ((alpha,) if alpha in channels else ())
    return Layout("Blender", names | missing, picture, tuple(notes), ADVICE)


def _views(channels: Iterable[str]) -> dict[str, set[str]]:
    """The passes of every view layer that has a picture by Cycles's name."""
    views: dict[str, set[str]] = {}
    for layer in layers_of(channels):
        view, _, name = layer.rpartition(".")
        views.setdefault(view, set()).add(name)
    return {view: passes for view, passes in views.items() if "Combined" in passes}


def _usefulness(passes: set[str]) -> int:
    """How many of the layers there are; the compositor's own `Composite` has none."""
    return len(_find(passes, PASSES | GUIDES))


def _find(passes: Iterable[str], wanted: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """The first name of each layer that is among the passes."""
    there = set(passes)
    found = {layer: [n for n in names if n in there] for layer, names in wanted.items()}
    return {layer: names[0] for layer, names in found.items() if names}


def _layer(view: str, name: str) -> str:
    return f"{view}.{name}" if view else name
