"""What the network reads, its layers, and what it does: host side of kernels_cl/network.

The twins in JAX are jflnr/network/features.py, unet.py, flnr.py and picture.py.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jflnr.network import features, picture, unet
from jflnr.opencl.arguments import to_device
from jflnr.opencl.context import Context
from jflnr.opencl.edges import blurred
from jflnr.opencl.grids import GROUP as MARGIN
from jflnr.opencl.grids import Images
from jflnr.opencl.moments import guide_arguments, guide_defines, pixel_defines

# Neighbours and outputs that one work-item computes: the 12 sums stay in a processor's 16 registers
# for vectors.
VECTORS, TOGETHER = 3, 4
# A vector may be read past the last row, where nothing that is kept comes from.
BEYOND = 64
# Of kernels_cl/network/read.h, and which of what is read of a pixel is its mask.
MEANS, MASK = 8, 13
DARK: dict[str, Any] = {"DARK": f"{features.DARK}f"}


class Maps(NamedTuple):
    """Channels over h x w blocks on the device, as kernels_cl/network/maps.h describes them.

    values: flat, of `(h + 2, channels, pitch)` and a little more.
    """

    values: Any
    channels: int
    h: int
    w: int
    pitch: int


def new_maps(context: Context, count: int, h: int, w: int) -> Maps:
    """Room for `count` channels. Whoever writes a channel also writes the zeros around it."""
    pixels = _vectors(context) * context.width()
    pitch = MARGIN + -(-(w + 1) // pixels) * pixels
    return Maps(context.empty(((h + 2) * count * pitch + BEYOND,)), count, h, w, pitch)


def _vectors(context: Context) -> int:
    """On a GPU neighbouring work-items read neighbours."""
    return VECTORS if context.on_cpu else 1


def correct(
    context: Context,
    params: unet.Params,
    images: Images,
    light: Any,
    error: Any,
    mean: Any,
    output: Any,
) -> None:
    """Write `light` `(H, W, C)`, corrected, to `output`, both float32; arguments on the device.

    images: as adaptive FLR took them. error: `(H, W, 1)`, of `light`. mean: of the frame's
    brightness.
    """
    target, _, weight, guides = images
    size = light.shape[:2]
    defines = pixel_defines(target, guides, weight, 1) | {"BRIGHTEST": f"{features.BRIGHTEST}f"}
    read = target, *guide_arguments(guides), weight, light, error, mean
    x, said = _said(context, params, size, features.Read.PIXEL, defines, read)
    defines = {"COUNTS": x.channels, "PIXEL": features.Read.PIXEL, "MASK": MASK}
    _write(context, said, (x.values,), light, output, defines)


def correct_picture(context: Context, params: unet.Params, read: picture.Read) -> np.ndarray:
    """The corrected picture, `(H, W, 3)`, of and to arrays of numpy."""
    images = [to_device(context, image) for image in read]
    named = dict(zip(read._fields, images, strict=True))
    size, defines = read.light.shape[:2], guide_defines((), 3) | {"PICTURE": 1}
    defines["MOST_SAMPLES"] = picture.MOST_SAMPLES
    _, said = _said(context, params, size, picture.Read.PIXEL, defines, images)
    result = np.empty(read.light.shape, np.float32)
    output = context.to_fill(result)
    lanes = context.width()
    left, shining = (context.empty((planes, *size)) for planes in (3, 4))
    arguments = size[1], size[0], named["light"], named["noisy"], named["weight"], left, shining
    only = guide_defines((), 3) | DARK | {"WIDTH": lanes}
    over = -(-size[1] // lanes), size[0]
    context.run("left_over", "network/left.cl", only, over, arguments)
    around = blurred(context, left, lanes)
    for _ in range(picture.NEAR):
        shining = blurred(context, shining, lanes)
    read_again = ("alpha", "samples", "own", "albedo", "albedo_left")
    others = *(named[name] for name in read_again), left, around, shining
    least = {"LEAST_LIGHT": picture.LEAST_LIGHT, "LEAST_ALBEDO": picture.LEAST_ALBEDO}
    written = {"PICTURE": 1, "MOST_TEXTURE": picture.MOST_TEXTURE} | DARK
    written |= {name: f"{value}f" for name, value in least.items()}
    _write(context, said, others, named["light"], output, written)
    return context.finish(output, result)


def _said(
    context: Context,
    params: unet.Params,
    size: tuple[int, int],
    pixel: int,
    defines: dict[str, Any],
    images: Sequence[Any],
) -> tuple[Maps, Maps]:
    """What the network reads, and what it says. size: of the image. pixel: values of each pixel."""
    arrays = {name: np.asarray(value, np.float32) for name, value in params.items()}
    scales, (height, width) = unet.scales_of(params), size
    h, w = (-(-length >> scales) << scales - 1 for length in size)
    x = new_maps(context, 4 * pixel + features.POOLED, h, w)
    means = new_maps(context, MEANS, h, w)
    defines = defines | DARK | {"WIDTH": context.width()}
    arguments = width, height, h, w, x.pitch, *images, x.values, means.values
    over, file = ((x.pitch - MARGIN) // context.width(), h), "network/features.cl"
    context.run("features", file, defines, over, arguments, alone=True)
    return x, apply(context, arrays, x, means)


def _write(
    context: Context, said: Maps, others: tuple, light: Any, output: Any, defines: dict[str, Any]
) -> None:
    """Write the light times what the network says. others: as kernels_cl/network/correct.cl."""
    height, width, channels = light.shape
    defines |= guide_defines((), channels) | {"WIDTH": context.width(), "SAID": said.channels // 4}
    defines["LARGEST"] = f"{features.LARGEST}f"
    size = (said.pitch - MARGIN) // context.width(), said.h
    arguments = width, height, said.h, said.w, said.pitch, said.values, *others, light, output
    context.run("correct", "network/correct.cl", defines, size, arguments)


def apply(context: Context, arrays: dict[str, Any], x: Maps, means: Maps) -> Maps:
    """What the network says. x: what it reads at half of the resolution. means: there."""
    scales = unet.scales_of(arrays)
    x = convolve(context, arrays, "stem", x)
    skips = []
    for i in range(scales):
        skips.append(convolve(context, arrays, f"encode{i}", x))
        if i + 1 < scales:
            width = arrays[f"down{i}"].shape[-1]
            x = new_maps(context, width + features.POOLED, x.h // 2, x.w // 2)
            convolve(context, arrays, f"down{i}", skips[-1], stride=2, to=x)
            means = _halved(context, means, x, 4.0 ** -(i + 2))
    x = skips.pop()
    for i in reversed(range(scales - 1)):
        x = _join(context, convolve(context, arrays, f"up{i}", x, leaky=False), skips.pop())
        x = convolve(context, arrays, f"decode{i}", x)
    x = convolve(context, arrays, "last", x)
    return convolve(context, arrays, "head", x, leaky=False)


def convolve(
    context: Context,
    arrays: dict[str, np.ndarray],
    name: str,
    x: Maps,
    *,
    stride: int = 1,
    to: Maps | None = None,
    leaky: bool = True,
) -> Maps:
    """The layer `name`.

    arrays: kernels `(k, k, I, O)` and biases `(O,)` by name. to: what is written to, from the first
    channel on; new maps if None.
    """
    kernel, bias = arrays[name], arrays[f"{name}_bias"]
    side, _, inputs, outputs = kernel.shape
    groups = -(-outputs // TOGETHER)
    together = -(-outputs // groups)
    if to is None:
        to = new_maps(context, outputs, -(-x.h // stride), -(-x.w // stride))
    missing = groups * together - outputs
    kernel = np.pad(kernel, [(0, 0)] * 3 + [(0, missing)]).reshape(side, side, inputs, groups, -1)
    weights = np.ascontiguousarray(kernel.transpose(3, 0, 2, 1, 4))
    width = context.width()
    defines = {
        "WIDTH": width, "SIDE": side, "STRIDE": stride, "TOGETHER": together,
        "VECTORS": _vectors(context),
    } | ({"LEAKY": 1} if leaky else {})  # fmt: skip
    arguments = (
        to.h, to.w, to.pitch, x.pitch, inputs, to.channels, outputs, context.array(weights),
        context.array(np.pad(bias, (0, missing))), x.values, to.values,
    )  # fmt: skip
    size = (to.pitch - MARGIN) // (_vectors(context) * width), groups, to.h + 2
    moved = 4 * (x.h * x.w * inputs + to.h * to.w * outputs + weights.size)
    file = "network/convolve.cl"
    context.run("convolve", file, defines, size, arguments, moved, alone=True)
    return to


def _halved(context: Context, means: Maps, to: Maps, part: float) -> Maps:
    """Means at half of the resolution; what is read of them goes to the last channels of `to`."""
    found = new_maps(context, MEANS, to.h, to.w)
    defines = DARK | {"WIDTH": context.width()}
    arguments = (
        to.h, to.w, found.pitch, means.pitch, to.channels, to.pitch, part, means.values,
        found.values, to.values,
    )  # fmt: skip
    size = (found.pitch - MARGIN) // context.width(), to.h + 2
    context.run("means", "network/means.cl", defines, size, arguments)
    return found


def _join(context: Context, x: Maps, skip: Maps) -> Maps:
    """The coarser scale repeated over 2 x 2 blocks, added to the finer."""
    width, to = context.width(), new_maps(context, skip.channels, skip.h, skip.w)
    size = (to.pitch - MARGIN) // width, to.channels, to.h + 2
    arguments = to.h, to.w, to.pitch, x.pitch, to.channels, x.values, skip.values, to.values
    context.run("join", "network/join.cl", {"WIDTH": width}, size, arguments)
    return to
