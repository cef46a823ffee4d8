"""Host side of kernels_cl/noisy_guides.cl; its twin in JAX is jflnr/images/noisy_guides.py."""

from typing import Any

from jflnr.checks import one_sentence
from jflnr.images.noisy_guides import DEPTH, NORMAL
from jflnr.opencl.arguments import to_layers
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.moments import guide_arguments, guide_defines

# Rows that one work-item goes down: of one more on each side it needs the mean too.
TALL = 10


@one_sentence()
def smooth_guide(guide: Any, normal: Any, depth: Any, context: Context | None = None) -> Any:
    """`jflnr.images.noisy_guides.smooth_guide` of one channel; the result is on the device."""
    context = default_context() if context is None else context
    layers = to_layers(context, (normal, depth, guide))
    height, width = normal.shape[:2]
    lanes = context.width()
    defines = {**guide_defines(layers, 1), "WIDTH": lanes}
    smooth = context.empty((height, width, 1))
    size = -(-width // lanes), -(-height // TALL)
    arguments = width, height, TALL, 1 / NORMAL, DEPTH, *guide_arguments(layers), smooth
    context.run("smooth", "noisy_guides.cl", defines, size, arguments)
    return smooth
