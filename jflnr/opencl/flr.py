"""Fast Local Regression on an OpenCL device: moments, blur, solve, apply (section 3.2)."""

import dataclasses
from typing import Any

from jflnr.checks import one_sentence
from jflnr.opencl.apply import apply
from jflnr.opencl.arguments import (
    check_guides,
    in_passes,
    to_image,
    to_layers,
    to_output,
    to_weight,
)
from jflnr.opencl.blur import blur
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.moments import centre, collect
from jflnr.opencl.solve import solve
from jflnr.regression.arguments import check_regression, layers_of
from jflnr.regression.flr import DEFAULT, FLR


@one_sentence()
@in_passes
def flr(
    target: Any,
    guides: Any,
    method: FLR = DEFAULT,
    *,
    guides_map: Any | None = None,
    weight: Any | None = None,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
    **options: Any,
) -> Any:
    """`jflnr.flr` on an OpenCL device: same arguments, same result.

    target, guides, guides_map and weight may be arrays of numpy or JAX, or device arrays
    (`pyopencl.array.Array` on the context's queue). Half and float are used as they are, anything
    else is converted to float. On a processor, contiguous arrays are used where they lie.
    context: device, programs and buffers, kept between frames; by default one for the best device.
    out: an array of the result's shape to write to, of numpy or on the device, float32 or float16.
    on_device: return a new device array; on a GPU without waiting for it.
    Returns `(H, W, C)`, or `(f H, f W, C)`, float32 unless `out` is given.

    Raises `ValueError` or `TypeError`, naming the argument; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    method = dataclasses.replace(method, **options)
    factor = check_regression(target, guides, guides_map, weight)
    shape = (*(layers_of(guides_map) or [target])[0].shape[:2], target.shape[2])
    method = method.at(factor, max(shape[:2]))
    y, channels = context.array(to_image(target)), target.shape[2]
    x, count = to_layers(context, guides), check_guides(guides)
    x_map = x if guides_map is None else to_layers(context, guides_map)
    output, result = to_output(context, shape, out, on_device)

    counts = to_weight(context, weight)
    shift = centre(context, x, counts)
    moments = collect(context, y, x, shift, method.block, counts)
    block, step = method.block, method.side
    size = -(-target.shape[0] // block), -(-target.shape[1] // block)
    reach = min(-(-(method.support or 0) // step), max(size))
    moments = blur(context, moments, float(method.sigma) / step, reach)
    model = solve(context, moments, shift, method, count, channels)
    apply(context, model, x_map, shift, step, (*size, model.shape[3]), output)
    return context.finish(output, result)
