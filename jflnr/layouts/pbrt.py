"""What the `gbuffer` film of pbrt-v4 writes.

`R G B Albedo.* P.* Ns.* N.* dzdx dzdy u v Variance.* RelativeVariance.*`; the vectors were called
`Px`, `Nx`, `Nsx` at first. Points are in camera coordinates unless the scene file says
`"string coordinatesystem" "world"`, which the file itself does not record.
"""

from collections.abc import Mapping

import numpy as np

from jflnr.layouts.channels import Layout

NOTE = "R, G, B is divided by Albedo and denoised"
WORLD = (
    "points behind z = 0 show that P is in world coordinates; depth comes from worldToCamera, and "
    "without it there is none"
)
BEAUTY, ALBEDO = ("R", "G", "B"), ("Albedo.R", "Albedo.G", "Albedo.B")
VECTORS = {"normal": ("Ns.", "N.", "Ns", "N"), "position": ("P.", "P")}


def layout(channels: Mapping[str, np.ndarray]) -> Layout | None:
    """None if this is no such file."""
    names = {layer: _vector(channels, stems) for layer, stems in VECTORS.items()}
    if not {*BEAUTY, *ALBEDO} <= set(channels) or not all(names.values()):
        return None
    names |= {"beauty": BEAUTY, "albedo": ALBEDO}
    z = names["position"][2]
    if (channels[z] < 0).any():
        return Layout("pbrt", names, BEAUTY, (NOTE, WORLD))
    return Layout("pbrt", names | {"depth": (z,)}, BEAUTY, (NOTE, f"depth is {z}"))


def _vector(channels: Mapping[str, np.ndarray], stems: tuple[str, ...]) -> tuple[str, ...]:
    """The channels of the first of `stems` that is there: `Ns.X` or, in the old way, `Nsx`."""
    for stem in stems:
        names = tuple(f"{stem}{c}" for c in ("XYZ" if stem.endswith(".") else "xyz"))
        if set(names) <= set(channels):
            return names
    return ()
