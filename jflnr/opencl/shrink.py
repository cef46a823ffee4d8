"""Host side of kernels_cl/shrink.cl; its twin in JAX is `shrink` of jflnr/images/guides.py."""

from typing import Any

from jflnr.opencl.arguments import to_device, to_layers
from jflnr.opencl.context import Context
from jflnr.opencl.moments import guide_defines


def shrink(image: Any, factor: int, mask: Any | None = None, *, context: Context) -> Any:
    """`jflnr.images.guides.shrink` on the device."""
    (height, width, channels), layers = image.shape, to_layers(context, image)
    h, w = -(-height // factor), -(-width // factor)
    means, defines = context.empty((h, w, channels)), guide_defines(layers, channels)
    counts = None if mask is None else to_device(context, mask)
    arguments = width, height, w, factor, *layers, counts, means
    if channels:
        context.run("shrink", "shrink.cl", defines | {"WIDTH": 1}, (w, h), arguments)
    return means
