"""Host side of kernels_cl/edges.cl; its twin in JAX is jflnr/regression/features.py."""

from typing import Any

import numpy as np

from jflnr.opencl.context import Context
from jflnr.regression.features import NEAR, REACH, WIDTH


def average(
    steer: Any, follow: Any, usable: Any, alike: Any, context: Context
) -> tuple[np.ndarray, np.ndarray]:
    """`jflnr.regression.features.average` on an OpenCL device, of and to arrays of numpy."""
    height, width = usable.shape
    arrays = (steer, follow, usable, np.broadcast_to(alike, usable.shape))
    image, values, counts, alike = (
        context.array(np.require(array, np.float32, ["C", "ALIGNED"])) for array in arrays
    )
    lanes = context.width()
    size = -(-width // lanes), height
    near = _blurred(context, image, lanes)
    tensor = context.empty((3, height, width))
    defines = {"WIDTH": lanes}
    arguments = (width, height, len(steer), near, tensor)
    context.run("structure", "edges.cl", defines, size, arguments)
    for _ in range(3):
        tensor = _blurred(context, tensor, lanes)
    results = np.empty((height, width), np.float32), np.empty(follow.shape, np.float32)
    outputs = [
        context.array(result, writable=True) if context.on_cpu else context.empty(result.shape)
        for result in results
    ]
    defines |= {"STEERING": len(steer), "FOLLOWING": len(follow), "REACH": REACH}
    arguments = (width, height, WIDTH**-2, NEAR**-2, near, tensor, values, counts, alike, *outputs)
    context.run("average", "edges.cl", defines, size, arguments, alone=True)
    for output, result in zip(outputs, results, strict=True):
        context.finish(output, result)
    return results


def _blurred(context: Context, image: Any, lanes: int) -> Any:
    planes, height, width = image.shape
    blurred = context.empty(image.shape)
    size = -(-width // lanes), height, planes
    context.run("blur", "edges.cl", {"WIDTH": lanes}, size, (width, height, planes, image, blurred))
    return blurred
