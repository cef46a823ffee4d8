"""Host side of kernels_cl/detail.cl; its twin in JAX is `jflnr.regression.picture.composed`."""

from typing import Any

import numpy as np

from jflnr.opencl.arguments import to_device, to_output
from jflnr.opencl.context import Context
from jflnr.opencl.edges import average
from jflnr.opencl.moments import guide_defines
from jflnr.regression.detail import ALIKE, BLOCK, DARK, FEWEST
from jflnr.stages import Parts


def composed(images: Parts, context: Context) -> np.ndarray:
    """`jflnr.regression.picture.composed` on an OpenCL device, of and to arrays of numpy."""
    names = "target", "image", "surface", "own", "weight"
    target, light, surface, own, weight = (to_device(context, images[name]) for name in names)
    height, width = target.shape[:2]
    h, w = (-(-length // BLOCK) for length in (height, width))
    unit = max(float(images["brightness"].flat[0]), 1e-12)
    lanes = context.width()
    size = -(-width // lanes), height
    defines: dict[str, Any] = guide_defines((), 3) | {"WIDTH": lanes}
    defines |= {"BLOCK": BLOCK, "FEWEST": f"{FEWEST}f"}
    usable, share = context.empty((height, width)), context.empty((h, w))
    steer, follow = (context.empty((planes, height, width)) for planes in (3, 4))

    def run(name: str, size: tuple[int, int], *arguments: Any) -> None:
        context.run(name, "detail.cl", defines, size, (width, height, *arguments))

    dark = DARK * unit
    run("left", size, unit, dark, target, light, surface, own, weight, steer, follow, usable)
    alike = np.full((height, width), ALIKE, np.float32)
    number, averages = average(context, steer, follow, usable, alike)
    run("shares", (w, h), w, h, number, averages, share)
    output, result = to_output(context, target.shape)
    run("composed", size, w, h, dark, light, surface, own, averages, share, output)
    return context.finish(output, result)
