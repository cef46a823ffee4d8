"""Host side of kernels_cl/apply.cl; its twin in JAX is jflnr/regression/apply.py."""

from typing import Any, NamedTuple

from jflnr.opencl.context import Context
from jflnr.opencl.grids import Grid, brightness_defines
from jflnr.opencl.moments import guide_arguments, guide_defines


class Restored(NamedTuple):
    """What is done to the light of adaptive FLR's models.

    rate, brightness: what they are scaled by, from `energy.restore`. own: light of the blocks, from
    `floor.own_light`. floor: least brightness of a pixel, relative to that.
    """

    rate: Any
    brightness: Any
    own: Grid
    floor: Any


def apply(
    context: Context,
    model: Any,
    guides: tuple[Any, ...],
    shift: Any,
    step: int,
    sizes: tuple[int, int, int],
    output: Any,
    restored: Restored | None = None,
) -> None:
    """`jflnr.regression.apply.apply` of models `(Q + 1, C, h, pitch)`, guides each `(H, W, Q_i)`.

    step: distance of the models in pixels. sizes: blocks down and across, and pitch. output:
    `(H, W, C)`, float32 or float16, is written. restored: for models as in kernels_cl/models.h.
    """
    height, width, channels = output.shape
    h, w, pitch = sizes
    lanes = context.width(step, across=True)
    defines = {**guide_defines(guides, channels), "STEP": step, "WIDTH": lanes}
    if output.dtype == "float16":
        defines["HALF_OUTPUT"] = 1
    arguments = [
        width, height, h, w, pitch, model, *guide_arguments(guides), shift, output
    ]  # fmt: skip
    if restored is not None:
        rate, brightness, own, floor = restored
        defines |= {"RESTORED": 1} | brightness_defines(channels)
        arguments += [brightness.shape[1], rate, brightness, own.planes, floor]
    # A vector lies in a cell between four block centres, or covers several side by side.
    strips = -(-(w + 1) // max(lanes // step, 1)) * -(-step // lanes)
    context.run("apply", "apply.cl", defines, (strips, h + 1), arguments)
