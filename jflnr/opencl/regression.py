"""Fast Local Regression on an OpenCL device: moments, blur, solve, apply (section 3.2)."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jflnr.flr.arguments import channel_count, check_regression
from jflnr.flr.parameters import Parameters
from jflnr.opencl.apply import apply
from jflnr.opencl.blur import blur
from jflnr.opencl.context import Context, default_context, is_device_array
from jflnr.opencl.moments import PARTS, centre, collect
from jflnr.opencl.solve import solve

MOST = {"guides": 16, "target": 9}


def flr(
    target: Any,
    guides: Any,
    parameters: Parameters,
    *,
    block: int = 8,
    support: int = 72,
    guides_map: Any | None = None,
    weight: Any | None = None,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
) -> Any:
    """`jflnr.flr.regression.flr` on an OpenCL device: same arguments, same result.

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
    factor = check_regression(target, guides, guides_map, weight, block, support)
    y, channels = context.array(_image(target)), target.shape[2]
    x, count = _layers(context, guides), channel_count(guides)
    _check_counts(count, channels)
    x_map = x if guides_map is None else _layers(context, guides_map)
    output, result = _output(context, _shape(target, guides_map), out, on_device)

    counts = _weight(context, weight)
    shift = centre(context, x, counts)
    moments = collect(context, y, x, shift, block, counts)
    step = block * factor
    moments = blur(context, moments, float(parameters.sigma) / step, reach=-(-support // step))
    model = solve(context, moments, shift, parameters, count, channels)
    size = -(-target.shape[0] // block), -(-target.shape[1] // block)
    apply(context, model, x_map, shift, step, size, output)
    return context.finish(output, result)


def _check_counts(guides: int, channels: int) -> None:
    for name, count in (("guides", guides), ("target", channels)):
        if count > MOST[name]:
            raise ValueError(
                f"{name} has {count} channels; the opencl backend takes at most {MOST[name]}"
            )


def _shape(target: Any, guides_map: Any | None) -> tuple[int, int, int]:
    layers = [] if guides_map is None else jax.tree.leaves(guides_map)
    return (*(layers[0] if layers else target).shape[:2], target.shape[2])


def _image(values: Any) -> Any:
    """As the kernels can read it: float16 or float32, in C order, a device array as it is."""
    if is_device_array(values):
        return values
    array = np.asarray(values)
    dtype = np.float16 if array.dtype == np.float16 else np.float32
    return np.require(array, dtype, ["C", "ALIGNED"])


def _layers(context: Context, guides: Any) -> tuple[Any, ...]:
    """The guides as at most `PARTS` device arrays of one type, none of them without channels."""
    layers = [_image(layer) for layer in jax.tree.leaves(guides) if layer.shape[2]]
    if len({layer.dtype for layer in layers}) > 1:
        layers = [layer.astype(np.float32) for layer in layers]
    if len(layers) > PARTS:
        layers = [*layers[: PARTS - 1], np.concatenate(layers[PARTS - 1 :], axis=2)]
    return tuple(context.array(layer) for layer in layers)


def _weight(context: Context, weight: Any | None) -> Any | None:
    if weight is None or is_device_array(weight):
        return weight
    array = np.asarray(weight)
    dtype = bool if array.dtype == bool else np.float32
    return context.array(np.require(array, dtype, ["C", "ALIGNED"]))


def _output(
    context: Context, shape: tuple[int, int, int], out: Any | None, on_device: bool
) -> tuple[Any, Any]:
    """The device array to write to, and what the caller gets: that array or a numpy array."""
    if out is None and on_device:
        output = context.empty(shape)
        return output, output
    result = np.empty(shape, np.float32) if out is None else out
    if result.shape != shape or result.dtype not in (np.float32, np.float16):
        raise ValueError(
            f"out must be a float32 or float16 array of shape {shape}; "
            f"got {result.dtype} of shape {result.shape}"
        )
    if is_device_array(result):
        return result, result
    if not (result.flags.c_contiguous and result.flags.writeable and result.flags.aligned):
        raise ValueError("out must be writable, aligned and in C order")
    if context.on_cpu:
        return context.array(result, writable=True), result
    return context.empty(shape, result.dtype), result
