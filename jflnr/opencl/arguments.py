"""From arrays of numpy or JAX to what the kernels of the regressions can read, and back."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from jflnr.opencl.context import Context, default_context, is_device_array
from jflnr.opencl.moments import PARTS
from jflnr.regression.arguments import channel_count, check_regression, layers_of

# Channels that the kernels take at once.
GUIDES, CHANNELS = 16, 9
# Light above this is divided by a power of two first: its squares would leave float32.
BRIGHT = 1e15


def run_on_images(
    write: Callable[..., None],
    target: Any,
    guides: Any,
    method: Any,
    *,
    guides_map: Any | None = None,
    weight: Any | None = None,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
    **options: Any,
) -> Any:
    """What a regression returns; arguments and errors as of `jflnr.opencl.flr`.

    write: the result, from context, `Images` and method, to a device array, and its error to
    another one or to none.
    """
    context = default_context() if context is None else context
    factor = check_regression(target, guides, guides_map, weight)
    if (count := channel_count(guides)) > GUIDES:
        raise ValueError(f"guides has {count} channels; the opencl backend takes at most {GUIDES}")
    method = dataclasses.replace(method, **options, factor=factor)
    size, channels = (layers_of(guides_map) or [target])[0].shape[:2], target.shape[2]
    output, result = to_output(context, (*size, channels), out, on_device)
    if channels > CHANNELS:
        others: dict[str, Any] = {"guides_map": guides_map, "weight": weight, "context": context}
        run = lambda light: run_on_images(write, light, guides, method, **others)
        return _in_passes(run, target, result, context)
    pixels, unit = in_unit(target)
    fitted = to_layers(context, guides)
    mapped = fitted if guides_map is None else to_layers(context, guides_map)
    images = context.array(pixels), fitted, to_weight(context, weight), mapped
    error = told = None
    if getattr(method, "with_error", False):
        error, told = to_output(context, (*size, 1), on_device=on_device)
    write(context, images, method, output, error)
    for array in (output, error):
        if unit != 1 and array is not None:
            context.scale(array, unit)
    image = context.finish(output, result)
    return image if error is None else (image, context.finish(error, told))


def _in_passes(run: Callable[[Any], Any], target: Any, result: Any, context: Context) -> Any:
    """Light of any number of channels to `result`, by a regression of at most `CHANNELS`.

    All channels are treated alike, by their brightness. So a pass takes, beside its own channels,
    the sum of those that it leaves out: weights, windows and corrections then are those of all.
    """
    light = target.get() if is_device_array(target) else np.asarray(target)
    image, count = np.empty(result.shape, result.dtype), light.shape[2]
    # Brightness is that of colours where channels come in threes: 6 and 3, or 7 and 1.
    colours = 3 if count % 3 == 0 else 1
    own = CHANNELS - 3 if colours == 3 else CHANNELS - 2
    error: list[Any] = []
    for start in range(0, count, own):
        mine = slice(min(start, count - own), min(start + own, count))
        others = np.delete(light, mine, axis=2).reshape(*light.shape[:2], -1, colours)
        given = run(np.concatenate([light[..., mine], others.sum(2, dtype=np.float32)], axis=2))
        part, *error = given if isinstance(given, tuple) else (given,)
        image[..., mine] = part[..., :own]
    if is_device_array(result):
        result.set(image)
        error = [context.array(plane) for plane in error]
    else:
        result[...] = image
    return (result, *error) if error else result


def in_unit(target: Any) -> tuple[Any, np.float32]:
    """The light, divided by what follows if it is so bright that its squares overflow.

    Told from a sparse grid; 1 where the light is on the device already.
    """
    pixels = to_image(target)
    if is_device_array(pixels):
        return pixels, np.float32(1)
    rows, columns = (slice(None, None, max(size // 32, 1)) for size in pixels.shape[:2])
    sample = np.abs(pixels[rows, columns])
    largest = float(np.max(sample, where=np.isfinite(sample), initial=0))
    if largest <= BRIGHT:
        return pixels, np.float32(1)
    unit = np.float32(2.0 ** (math.frexp(largest)[1] - 1))
    return pixels / unit, unit


def to_image(values: Any, kept: Any = np.float16) -> Any:
    """As the kernels can read it: of type `kept` or else float32, in C order. A device array as it
    is."""
    if is_device_array(values):
        return values
    array = np.asarray(values)
    dtype = kept if array.dtype == kept else np.float32
    return np.require(array, dtype, ["C", "ALIGNED"])


def to_device(context: Context, layer: Any, kept: Any = np.float32) -> Any:
    """A layer as a device array of float32 or, if it is of it already, of type `kept`."""
    return context.array(to_image(layer, kept))


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
    return None if weight is None else to_device(context, weight, bool)


def to_output(
    context: Context, shape: tuple[int, ...], out: Any | None = None, on_device: bool = False
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
