"""Fast Local Regression on an OpenCL device: moments, blur, solve, apply (section 3.2)."""

from typing import Any

from jflnr.checks import one_sentence
from jflnr.opencl.apply import apply
from jflnr.opencl.arguments import run_on_images
from jflnr.opencl.blur import blur
from jflnr.opencl.context import Context
from jflnr.opencl.grids import Images
from jflnr.opencl.moments import centre, collect
from jflnr.opencl.solve import solve
from jflnr.regression.arguments import channel_count
from jflnr.regression.flr import DEFAULT, FLR


@one_sentence()
def flr(target: Any, guides: Any, method: FLR = DEFAULT, **options: Any) -> Any:
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
    return run_on_images(write, target, guides, method, **options)


def write(context: Context, images: Images, method: FLR, output: Any, error: None) -> None:
    """Write the light, `(H, W, C)`; this method tells no error."""
    target, guides, weight, guides_map = images
    method = method.at(method.factor, max(output.shape[:2]))
    shift = centre(context, guides, weight)
    moments = collect(context, target, guides, shift, method.block, weight)
    block, step = method.block, method.side
    size = -(-target.shape[0] // block), -(-target.shape[1] // block)
    reach = min(-(-(method.support or 0) // step), max(size))
    moments = blur(context, moments, float(method.sigma) / step, reach)
    model = solve(context, moments, shift, method, channel_count(guides), target.shape[2])
    apply(context, model, guides_map, shift, step, (*size, model.shape[3]), output)
