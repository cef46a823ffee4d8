"""What Blender's Cycles writes as OpenEXR MultiLayer: `<view layer>.<pass>.<component>`.

Facts taken from files that Blender 4.5 and 5.0 wrote (tests/layouts/test_blender.py): the light
passes are divided by the pass `Diffuse Color`, all passes together sum to `Combined`, the depth is
measured along the view axis and 1e10 where nothing is hit, normals face the camera, and motion
counts upwards.
"""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from jflnr.exr import layers_of
from jflnr.layouts.channels import Layout, Lobe, in_layer

# Names since Blender 5.0, then those up to 4.x. `Noisy Image` is the picture before Blender's own
# denoiser, which `Combined` is after.
BEAUTY = ("Noisy Image", "Combined")
PASSES = {
    "indirect": ("Diffuse Indirect", "DiffInd"),
    "direct": ("Diffuse Direct", "DiffDir"),
    "albedo": ("Diffuse Color", "DiffCol"),
}
WHOLE_PICTURE = {
    "beauty": BEAUTY,
    "emission": ("Emission", "Emit"),
    "environment": ("Environment", "Env"),
    "seen_albedo": ("Denoising Albedo",),
    "seen_normal": ("Denoising Normal",),
}
# Of every lobe its colour, and the passes that are divided by it; volumes have no colour.
LOBES = (
    (("Diffuse Color", "DiffCol"), ("Diffuse Direct", "DiffDir"), ("Diffuse Indirect", "DiffInd")),
    (("Glossy Color", "GlossCol"), ("Glossy Direct", "GlossDir"), ("Glossy Indirect", "GlossInd")),
    (
        ("Transmission Color", "TransCol"),
        ("Transmission Direct", "TransDir"),
        ("Transmission Indirect", "TransInd"),
    ),
    ((), ("Volume Direct", "VolumeDir"), ("Volume Indirect", "VolumeInd")),
)
GUIDES = {
    "normal": ("Normal", "Denoising Normal"),
    "depth": ("Depth", "Denoising Depth"),
    "position": ("Position",),
    "motion": ("Vector",),  # X, Y: to where the point was, upwards; Z, W: from where it will be
}
NEEDED = {"albedo": "Diffuse Color", "normal": "Normal"}

ADVICE = {
    "albedo": "switch on Diffuse Color under View Layer > Passes > Light, or Denoising Data",
    "normal": "switch on Normal under View Layer > Passes > Data",
}
# Of no use as a guide is `Ambient Occlusion`: one ray per sample makes it as noisy as the light.


def layout(channels: Mapping[str, np.ndarray]) -> Layout | None:
    """That of the view layer with the most passes, or None if this is no file of Blender's."""
    views = _views(channels)
    if not views:
        return None
    view = max(views, key=lambda view: _usefulness(views[view]))
    light = _find(views[view], PASSES)
    if not {"indirect", "albedo"} <= set(light):
        light = _find(views[view], {"albedo": ("Denoising Albedo", *PASSES["albedo"])})
    chosen = NEEDED | light | _find(views[view], GUIDES | WHOLE_PICTURE)
    stems = {layer: _layer(view, name) for layer, name in chosen.items()}
    names = {layer: in_layer(channels, stem) or (f"{stem}.R",) for layer, stem in stems.items()}
    names |= {"motion": names["motion"][:2]} if "motion" in names else {}
    if "indirect" in names and not set(names["beauty"]) <= set(channels):
        del names["beauty"]  # an alpha alone
    combined = _layer(view, "Combined")
    picture = in_layer(channels, combined)
    picture += tuple({f"{combined}.A"} & set(channels)) if len(picture) == 3 else ()
    lobes = tuple(_lobes(channels, view))
    if "seen_albedo" not in names and (
        colours := [lobe.colour for lobe in lobes if any(lobe.colour)]
    ):
        names["seen_albedo"] = sum(colours, ())
    others = ", ".join(sorted(set(views) - {view}))
    note = f"view layer {view} is used; the file also holds {others}"
    return Layout("Blender", names, picture, (note,) if others else (), ADVICE, True, lobes)


def _lobes(channels: Mapping[str, np.ndarray], view: str) -> Iterator[Lobe]:
    """The kinds of surfaces that have a colour and at least one pass."""
    for layers in LOBES:
        colour, *passes = (
            next((c for name in names if len(c := in_layer(channels, _layer(view, name))) == 3), ())
            for names in layers
        )
        if (colour or not layers[0]) and any(passes):
            yield Lobe(*(tuple(found) or ("", "", "") for found in (colour, *passes)))


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
