"""The U-Net on blocks: host side of kernels_cl/network/convolve.cl and repeat.cl.

Its twin in JAX is jflnr/network/unet.py.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jflnr.network import unet
from jflnr.opencl.context import Context
from jflnr.opencl.grids import GROUP as MARGIN

# Neighbours and outputs that one work-item computes: the 12 sums stay in a processor's 16 registers
# for vectors.
VECTORS, TOGETHER = 3, 4
# A vector may be read past the last row, where nothing that is kept comes from.
BEYOND = 64


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


def apply(context: Context, params: unet.Params, x: Maps) -> list[Maps]:
    """The outputs of every scale that has a head, fine to coarse; the twin is `network.unet.apply`."""
    arrays = {name: np.asarray(value, np.float32) for name, value in params.items()}
    widths = [arrays[name].shape[-1] for name in sorted(arrays) if name[:-1] == "encode"]
    x = convolve(context, arrays, "stem", x)
    skips = []
    for i, width in enumerate(widths):
        last = i + 1 == len(widths)
        # What comes from the coarser scale will lie in front of what this one hands on.
        room = 0 if last else widths[i + 1]
        skip = new_maps(context, room + width, x.h, x.w)
        convolve(context, arrays, f"encode{i}", x, to=skip, to_first=room)
        skips.append(skip)
        if not last:
            x = convolve(context, arrays, f"down{i}", skip, first=room, stride=2)
    x = skips.pop()
    outputs = _head(context, arrays, len(widths) - 1, x)
    for i in reversed(range(len(skips))):
        repeat(context, x, skips[i])
        x = convolve(context, arrays, f"join{i}", skips[i])
        x = convolve(context, arrays, f"decode{i}", x)
        outputs = _head(context, arrays, i, x) + outputs
    return outputs


def _head(context: Context, arrays: dict[str, np.ndarray], scale: int, x: Maps) -> list[Maps]:
    name = f"head{scale}"
    return [convolve(context, arrays, name, x, leaky=False)] if name in arrays else []


def convolve(
    context: Context,
    arrays: dict[str, np.ndarray],
    name: str,
    x: Maps,
    *,
    first: int = 0,
    stride: int = 1,
    to: Maps | None = None,
    to_first: int = 0,
    leaky: bool = True,
) -> Maps:
    """The layer `name`, from the channels of `x` from `first` on.

    arrays: kernels `(k, k, I, O)` and biases `(O,)` by name. to: what is written to, from channel
    `to_first` on; new maps if None.
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
        to.h, to.w, to.pitch, x.pitch, x.channels, first, inputs, to.channels, to_first, outputs,
        context.array(weights), context.array(np.pad(bias, (0, missing))), x.values, to.values,
    )  # fmt: skip
    size = (to.pitch - MARGIN) // (_vectors(context) * width), groups, to.h + 2
    moved = 4 * (x.h * x.w * inputs + to.h * to.w * outputs + weights.size)
    file = "network/convolve.cl"
    context.run("convolve", file, defines, size, arguments, moved, alone=True)
    return to


def repeat(context: Context, x: Maps, to: Maps) -> None:
    """Repeat every value over 2 x 2 blocks, into the first channels of `to`."""
    width = context.width()
    size = (to.pitch - MARGIN) // width, x.channels, to.h + 2
    arguments = to.h, to.w, to.pitch, x.pitch, x.channels, to.channels, x.values, to.values
    moved = 5 * 4 * x.h * x.w * x.channels
    context.run("repeat", "network/repeat.cl", {"WIDTH": width}, size, arguments, moved)
