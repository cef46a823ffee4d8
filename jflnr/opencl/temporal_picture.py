"""Host side of kernels_cl/temporal/picture.cl; its twin in JAX is jflnr/temporal/picture.py."""

from typing import Any

import numpy as np

from jflnr.images.guides import mean_light
from jflnr.opencl.arguments import to_device
from jflnr.opencl.context import Context
from jflnr.opencl.grids import brightness_defines
from jflnr.temporal.picture import AROUND, DARK, EXPLAINED, LEAST, LEAST_NOISE, MOST, Past


def follow(
    context: Context, past: Past, picture: np.ndarray, error: np.ndarray, motion: Any
) -> Past:
    """`jflnr.temporal.picture.follow`, of arrays of numpy and a past on the device."""
    height, width, channels = picture.shape
    usable = np.isfinite(picture).all(axis=-1, keepdims=True) & np.isfinite(error)
    with np.errstate(over="ignore"):
        unit = mean_light(np.where(usable, np.maximum(picture[..., :3], 0), 0))
    images = [to_device(context, np.ascontiguousarray(a, np.float32)) for a in (picture, error)]
    after = Past(context.empty(picture.shape), context.empty((height, width, 1)))
    moved, planes = context.empty(picture.shape), context.empty((4, height, width))
    defines: dict[str, Any] = {"WIDTH": 1, "CHANNELS": channels, "AROUND": AROUND}
    numbers = {"LEAST": LEAST, "EXPLAINED": EXPLAINED, "DARK": DARK}
    numbers |= {"LEAST_NOISE": LEAST_NOISE, "MOST": MOST}
    defines |= {name: f"{value}f" for name, value in numbers.items()} | brightness_defines(3)
    compared = width, height, float(unit), *images, to_device(context, motion), *past
    file, size = "temporal/picture.cl", (width, height)
    context.run("compare", file, defines, size, (*compared, moved, planes))
    context.run("follow", file, defines, size, (width, height, images[0], moved, planes, *after))
    result: Any = after.picture
    context.finish(result, result)
    return after
