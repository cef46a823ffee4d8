"""A U-Net on blocks: pure functions over a plain pytree of arrays (section 3.3).

Two 3x3 convolutions per scale as in the paper, LeakyReLU, no batch normalisation. The first layer
is 1x1: its input is a few finer blocks side by side, so that no convolution runs on fine grids.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from jflnr.lazy import jax, jnp, lax

Params: TypeAlias = "dict[str, jax.Array]"


def init(key: jax.Array, inputs: int, widths: Sequence[int], heads: Sequence[int]) -> Params:
    """Random weights (He et al. 2015), but zeros where the outputs come from.

    inputs: channels read. widths: channels of each scale, fine to coarse. heads: channels to
    give at each scale, 0 for none; the coarsest has none if there are fewer heads than scales.
    """
    shapes = {"stem": (1, 1, inputs, widths[0])}
    for i, width in enumerate(widths):
        shapes[f"encode{i}"] = (3, 3, width, width)
        if i + 1 < len(widths):
            shapes[f"down{i}"] = (3, 3, width, widths[i + 1])
            shapes[f"join{i}"] = (3, 3, width + widths[i + 1], width)
            shapes[f"decode{i}"] = (3, 3, width, width)
    params = layers(key, shapes)
    for i, outputs in enumerate(heads):
        if outputs:
            params[f"head{i}"] = jnp.zeros((1, 1, widths[i], outputs))
            params[f"head{i}_bias"] = jnp.zeros(outputs)
    return params


def layers(key: jax.Array, shapes: Mapping[str, tuple[int, ...]]) -> Params:
    """Random convolutions that keep the variance (He et al. 2015), and biases of 0."""
    params = {}
    for name, shape in shapes.items():
        key, own = jax.random.split(key)
        deviation = (2 / (shape[0] * shape[1] * shape[2])) ** 0.5
        params[name] = deviation * jax.random.normal(own, shape)
        params[f"{name}_bias"] = jnp.zeros(shape[-1])
    return params


def apply(params: Params, x: jax.Array) -> list[jax.Array]:
    """The outputs of every scale.

    x: `(h, w, inputs)`, any size. Returns `(ceil(h / 2^i), ceil(w / 2^i), heads[i])` for scale i.
    """
    scales = scales_of(params)
    x = _layer(params, "stem", x)
    skips = []
    for i in range(scales):
        x = _layer(params, f"encode{i}", x)  # (h / 2^i, w / 2^i, widths[i])
        skips.append(x)
        if i + 1 < scales:
            x = _layer(params, f"down{i}", x, stride=2)  # (h / 2^(i+1), w / 2^(i+1), widths[i+1])
    outputs = [_head(params, scales - 1, x)]
    for i in reversed(range(scales - 1)):
        x = jnp.concatenate([upsample(x, *skips[i].shape[:2]), skips[i]], axis=-1)
        x = _layer(params, f"decode{i}", _layer(params, f"join{i}", x))
        outputs.append(_head(params, i, x))
    return outputs[::-1]


def scales_of(params: Params) -> int:
    """On how many scales the network works."""
    return sum(name.startswith("encode") and name[-1].isdigit() for name in params)


def reach_of(scales: int) -> int:
    """How many values beyond its own an output of the finest scale depends on.

    On every scale a convolution before the next one and two after it; one that leads there, and one
    value for what is repeated.
    """
    reach = 1
    for _ in range(scales - 1):
        reach = 1 + 1 + 2 * (reach + 1) + 2
    return reach


def convolve(x: jax.Array, kernel: jax.Array, bias: jax.Array, stride: int = 1) -> jax.Array:
    """Convolution with zeros beyond the border.

    x: `(h, w, I)`. kernel: `(k, k, I, O)`. Returns `(ceil(h / stride), ceil(w / stride), O)`.
    """
    margin = [(k // 2, k // 2) for k in kernel.shape[:2]]
    numbers = ("NHWC", "HWIO", "NHWC")
    strides = (stride, stride)
    out = lax.conv_general_dilated(x[None], kernel, strides, margin, dimension_numbers=numbers)
    return out[0] + bias


def upsample(x: jax.Array, height: int, width: int) -> jax.Array:
    """Every value repeated over 2 x 2 blocks: `(h, w, C)` to `(height, width, C)`, cut."""
    return jnp.repeat(jnp.repeat(x, 2, axis=0), 2, axis=1)[:height, :width]


def pack(planes: jax.Array) -> jax.Array:
    """2 x 2 blocks side by side as channels: `(C, h, w)` to `(ceil(h/2), ceil(w/2), 4 C)`."""
    count, height, width = planes.shape
    planes = jnp.pad(planes, ((0, 0), (0, height % 2), (0, width % 2)), mode="edge")
    height, width = planes.shape[1] // 2, planes.shape[2] // 2
    blocks = planes.reshape(count, height, 2, width, 2)
    return blocks.transpose(1, 3, 0, 2, 4).reshape(height, width, 4 * count)


def unpack(x: jax.Array, height: int, width: int) -> jax.Array:
    """The inverse of `pack`: `(h, w, 4 C)` to `(C, height, width)`."""
    h, w, count = x.shape
    blocks = x.reshape(h, w, count // 4, 2, 2).transpose(2, 0, 3, 1, 4)
    return blocks.reshape(count // 4, 2 * h, 2 * w)[:, :height, :width]


def _layer(params: Params, name: str, x: jax.Array, stride: int = 1) -> jax.Array:
    return jax.nn.leaky_relu(convolve(x, params[name], params[f"{name}_bias"], stride), 0.1)


def _head(params: Params, scale: int, x: jax.Array) -> jax.Array:
    if f"head{scale}" not in params:
        return x[..., :0]
    return convolve(x, params[f"head{scale}"], params[f"head{scale}_bias"])
