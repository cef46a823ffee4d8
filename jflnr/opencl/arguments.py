"""Arguments of the regressions, from arrays of numpy or JAX to what the kernels can read."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from jflnr.opencl.context import Context, default_context, is_device_array
from jflnr.opencl.moments import PARTS
from jflnr.regression.arguments import channel_count, layers_of

# Channels that the kernels take at once.
GUIDES, CHANNELS = 16, 9


def check_guides(guides: Any) -> int:
    """The number of channels of all guides; `ValueError` if it is more than the kernels take."""
    count = channel_count(guides)
    if count > GUIDES:
        raise ValueError(f"guides has {count} channels; the opencl backend takes at most {GUIDES}")
    return count


def in_passes(regress: Callable[..., Any]) -> Callable[..., Any]:
    """The regression, of light of any number of channels: in passes over some of them.

    All channels are treated alike, by their brightness. So a pass takes, beside its own channels,
    the sum of those that it leaves out: weights, windows and corrections then are those of all.
    """

    @functools.wraps(regress)
    def run(
        target: Any,
        guides: Any,
        *method: Any,
        context: Context | None = None,
        out: Any | None = None,
        on_device: bool = False,
        **options: Any,
    ) -> Any:
        count = target.shape[2] if len(getattr(target, "shape", ())) == 3 else 0
        if count <= CHANNELS:
            options |= {"context": context, "out": out, "on_device": on_device}
            return regress(target, guides, *method, **options)
        context = default_context() if context is None else context
        light = target.get() if is_device_array(target) else np.asarray(target)
        size = (layers_of(options.get("guides_map")) or [target])[0].shape[:2]
        _, result = to_output(context, (*size, count), out, on_device)
        image = np.empty(result.shape, result.dtype)
        # Brightness is that of colours where channels come in threes: 6 and 3, or 7 and 1.
        colours = 3 if count % 3 == 0 else 1
        own = CHANNELS - 3 if colours == 3 else CHANNELS - 2
        error: list[Any] = []
        for start in range(0, count, own):
            mine = slice(min(start, count - own), min(start + own, count))
            others = np.delete(light, mine, axis=2).reshape(*light.shape[:2], -1, colours)
            both = np.concatenate([light[..., mine], others.sum(2, dtype=np.float32)], axis=2)
            given = regress(both, guides, *method, context=context, **options)
            part, *error = given if isinstance(given, tuple) else (given,)
            image[..., mine] = part[..., :own]
        if is_device_array(result):
            result.set(image)
            error = [context.array(plane) for plane in error]
        else:
            result[...] = image
        return (result, *error) if error else result

    return run


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
