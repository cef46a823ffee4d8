"""What the network reads, its layers, and what it does: host side of kernels_cl/network.

The twins in JAX are jflnr/network/features.py, unet.py and flnr.py.
"""

from typing import Any, NamedTuple

import numpy as np

from jflnr.network import features, unet
from jflnr.network.flnr import LARGEST
from jflnr.opencl.context import Context
from jflnr.opencl.grids import GROUP as MARGIN
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
    target: Any,
    guides: tuple[Any, ...],
    weight: Any | None,
    light: Any,
    error: Any,
    mean: Any,
    output: Any,
) -> None:
    """Write `light` `(H, W, C)`, corrected, to `output`, both float32; arguments on the device.

    target, guides, weight: as adaptive FLR took them. error: `(H, W, 1)`, of `light`. mean: of the
    frame's brightness.
    """
    arrays = {name: np.asarray(value, np.float32) for name, value in params.items()}
    scales = unet.scales_of(params)
    height, width, channels = light.shape
    h, w = (-(-size >> scales) << scales - 1 for size in (height, width))
    x = new_maps(context, 4 * features.PIXEL + features.POOLED, h, w)
    means = new_maps(context, MEANS, h, w)
    defines: dict[str, Any] = pixel_defines(target, guides, weight, 1) | DARK
    defines |= {"WIDTH": context.width(), "BRIGHTEST": f"{features.BRIGHTEST}f"}
    arguments = (
        width, height, h, w, x.pitch, target, *guide_arguments(guides), weight, light, error, mean,
        x.values, means.values,
    )  # fmt: skip
    size, file = ((x.pitch - MARGIN) // context.width(), h), "network/features.cl"
    context.run("features", file, defines, size, arguments, alone=True)
    said = apply(context, arrays, x, means)
    defines = guide_defines((), channels) | {
        "WIDTH": context.width(), "LARGEST": f"{LARGEST}f", "COUNTS": x.channels,
        "PIXEL": features.PIXEL, "MASK": MASK,
    }  # fmt: skip
    of_light = width, height, h, w, x.pitch, said.values, x.values, light, output
    context.run("correct", "network/correct.cl", defines, size, of_light)


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
