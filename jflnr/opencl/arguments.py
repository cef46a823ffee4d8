"""Arguments of the regressions, from arrays of numpy or JAX to what the kernels can read."""

import dataclasses
from typing import Any

import numpy as np

from jflnr.opencl.context import Context, is_device_array
from jflnr.opencl.moments import PARTS
from jflnr.regression.arguments import layers_of

MOST = {"guides": 16, "target": 9}


def check_counts(guides: int, channels: int) -> None:
    """Raise `ValueError` if there are more channels than the kernels take."""
    for name, count in (("guides", guides), ("target", channels)):
        if count > MOST[name]:
            raise ValueError(
                f"{name} has {count} channels; the opencl backend takes at most {MOST[name]}"
            )


def numbers_of(method: Any) -> Any:
    """The method with its numbers as those of Python; other fields stay."""
    fields = ((field, getattr(method, field.name)) for field in dataclasses.fields(method))
    return dataclasses.replace(
        method,
        **{
            field.name: float(value)
            for field, value in fields
            if value is not None
            and not isinstance(value, dict)
            and not field.metadata.get("static")
        },
    )


def to_image(values: Any) -> Any:
    """As the kernels can read it: float16 or float32, in C order, a device array as it is."""
    if is_device_array(values):
        return values
    array = np.asarray(values)
    dtype = np.float16 if array.dtype == np.float16 else np.float32
    return np.require(array, dtype, ["C", "ALIGNED"])


def to_device(context: Context, layer: Any) -> Any:
    """A layer as a device array of float32."""
    if is_device_array(layer):
        return layer
    return context.array(np.require(layer, np.float32, ["C", "ALIGNED"]))


def to_layers(context: Context, guides: Any) -> tuple[Any, ...]:
    """The guides as at most `PARTS` device arrays of one type, none of them without channels."""
    layers = [to_image(layer) for layer in layers_of(guides) if layer.shape[2]]
    if len({layer.dtype for layer in layers}) > 1:
        layers = [layer.astype(np.float32) for layer in layers]
    if len(layers) > PARTS:
        layers = [*layers[: PARTS - 1], np.concatenate(layers[PARTS - 1 :], axis=2)]
    return tuple(context.array(layer) for layer in layers)


def to_weight(context: Context, weight: Any | None) -> Any | None:
    """Weights `(H, W)` as a device array of float32 or bool, or None."""
    if weight is None or is_device_array(weight):
        return weight
    array = np.asarray(weight)
    dtype = bool if array.dtype == bool else np.float32
    return context.array(np.require(array, dtype, ["C", "ALIGNED"]))


def to_output(
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
