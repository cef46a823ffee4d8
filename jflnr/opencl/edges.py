"""Host side of kernels_cl/edges.cl and layers.cl; its twin is jflnr/regression/features.py."""

from typing import Any

import numpy as np

from jflnr.opencl.arguments import to_device, to_output
from jflnr.opencl.context import Context
from jflnr.opencl.moments import guide_defines
from jflnr.regression.features import NEAR, NOTHING, REACH, WIDTH, alike_of
from jflnr.regression.picture import steer_of


def filter_layers(
    layers: dict[str, Any], unit: Any, samples: Any, context: Context
) -> tuple[np.ndarray, ...]:
    """`jflnr.regression.picture.filter_layers` on an OpenCL device, of and to arrays of numpy."""
    images = [to_device(context, layer) for layer in layers.values()]
    height, width = images[0].shape[:2]
    lanes = context.width()
    size = -(-width // lanes), height
    ends = np.cumsum([image.shape[2] for image in images]).tolist()
    places = dict(zip(layers, [0, *ends[:-1]], strict=True))
    steered = {name: how for name in layers if (how := steer_of(name, unit)) is not None}
    counts = [1 if how.mean else layers[name].shape[2] for name, how in steered.items()]
    usable, one, two = (context.empty((height, width)) for _ in range(3))
    follow, steer = (context.empty((count, height, width)) for count in (ends[-1], sum(counts)))

    def run(name: str, layer: str, *arguments: Any) -> None:
        defines = guide_defines((), layers[layer].shape[2]) | {"WIDTH": lanes}
        context.run(name, "layers.cl", defines, size, (width, height, *arguments))

    for name, image in zip(layers, images, strict=True):
        run("spread", name, places[name], image, follow, usable)
    to = 0
    for (name, how), count in zip(steered.items(), counts, strict=True):
        covers = how.least is not None
        if covers:
            run("peaks", name, places[name], int(how.mean), follow, one)
            run("most", name, 0, one, two)
            run("most", name, 1, two, one)
            peak = blurred(context, blurred(context, one[None], lanes), lanes)
        numbers = int(how.mean), int(covers), how.factor, float(how.least or 0), to
        run("steer", name, places[name], *numbers, follow, peak if covers else one, usable, steer)
        to += count
    alike = np.broadcast_to(alike_of(np.asarray(samples)), (height, width))
    number, averages = average(context, steer, follow, usable, alike)
    outputs = [to_output(context, image.shape) for image in images]
    for name, (output, _) in zip(layers, outputs, strict=True):
        run("gather", name, places[name], NOTHING, number, averages, follow, output)
    return tuple(context.finish(*output) for output in outputs)


def average(context: Context, steer: Any, follow: Any, usable: Any, alike: Any) -> tuple[Any, Any]:
    """`jflnr.regression.features.average` on an OpenCL device, to device arrays."""
    image, values, counts, alike = (
        to_device(context, array) for array in (steer, follow, usable, alike)
    )
    height, width = usable.shape
    lanes = context.width()
    size = -(-width // lanes), height
    near = blurred(context, image, lanes)
    tensor = context.empty((3, height, width))
    defines = {"WIDTH": lanes}
    context.run("structure", "edges.cl", defines, size, (width, height, len(steer), near, tensor))
    for _ in range(3):
        tensor = blurred(context, tensor, lanes)
    results = context.empty((height, width)), context.empty(values.shape)
    defines |= {"STEERING": len(steer), "FOLLOWING": len(follow), "REACH": REACH}
    arguments = (width, height, WIDTH**-2, NEAR**-2, near, tensor, values, counts, alike, *results)
    context.run("average", "edges.cl", defines, size, arguments, alone=True)
    return results


def blurred(context: Context, image: Any, lanes: int) -> Any:
    """The mean of planes over 3 x 3 pixels with the weights 1, 2, 1, on the device."""
    planes, height, width = image.shape
    result = context.empty(image.shape)
    size = -(-width // lanes), height, planes
    context.run("blur", "edges.cl", {"WIDTH": lanes}, size, (width, height, planes, image, result))
    return result
