"""A U-Net at half of the image's resolution: pure functions over a plain pytree of arrays.

As in section 3.3 3 x 3 convolutions over several scales, LeakyReLU, no batch normalisation. The
first layer is 1 x 1: 2 x 2 pixels lie side by side as channels. Skips are added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from jflnr.lazy import jax, jnp, lax

Params: TypeAlias = "dict[str, jax.Array]"


def init(key: jax.Array, inputs: int, means: int, widths: Sequence[int], outputs: int) -> Params:
    """Random weights (He et al. 2015), but zeros where the outputs come from.

    inputs: channels read at every pixel; means: more at every scale. widths: channels of each
    scale, fine to coarse. outputs: channels to give at every pixel.
    """
    shapes = {"stem": (1, 1, 4 * inputs + means, widths[0])}
    for i, width in enumerate(widths):
        shapes[f"encode{i}"] = (3, 3, width + (means if i else 0), width)
        if i + 1 < len(widths):
            shapes[f"down{i}"] = (3, 3, width, widths[i + 1])
            shapes[f"up{i}"] = (1, 1, widths[i + 1], width)
            shapes[f"decode{i}"] = (3, 3, width, width)
    shapes["last"] = (3, 3, widths[0], widths[0])
    params = layers(key, shapes)
    params["head"] = jnp.zeros((1, 1, widths[0], 4 * outputs))
    params["head_bias"] = jnp.zeros(4 * outputs)
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


def apply(params: Params, pixels: jax.Array, means: Sequence[jax.Array]) -> jax.Array:
    """The outputs at every pixel, `(H, W, outputs)`.

    pixels: `(H, W, inputs)`, H and W multiples of two to the number of scales. means: of every
    scale, `(H / 2, W / 2, means)`, `(H / 4, W / 4, means)`, ...
    """
    scales = scales_of(params)
    x = _layer(params, "stem", jnp.concatenate([pack(pixels), means[0]], axis=-1))
    skips = []
    for i in range(scales):
        if i:
            x = jnp.concatenate([x, means[i]], axis=-1)
        x = _layer(params, f"encode{i}", x)  # (H / 2^(i+1), W / 2^(i+1), widths[i])
        skips.append(x)
        if i + 1 < scales:
            x = _layer(params, f"down{i}", x, stride=2)  # (H / 2^(i+2), W / 2^(i+2), widths[i+1])
    for i in reversed(range(scales - 1)):
        coarse = convolve(x, params[f"up{i}"], params[f"up{i}_bias"])
        x = _leaky(upsample(coarse, *skips[i].shape[:2]) + skips[i])
        x = _layer(params, f"decode{i}", x)
    x = _layer(params, "last", x)
    return unpack(convolve(x, params["head"], params["head_bias"]))


def scales_of(params: Params) -> int:
    """On how many scales the network works."""
    return sum(name.startswith("encode") and name[-1].isdigit() for name in params)


def reach_of(scales: int) -> int:
    """How many pixels beyond its 2 x 2 an output depends on, beside what the means cover.

    On every scale a convolution after the next one and one before it; one that leads there, and one
    value for what is repeated; on the finest one more.
    """
    reach = 1
    for _ in range(scales - 1):
        reach = 1 + 1 + 2 * reach + 1 + 1
    return 2 * (reach + 1)


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


def pack(image: jax.Array) -> jax.Array:
    """2 x 2 pixels side by side as channels: `(2 h, 2 w, C)` to `(h, w, 4 C)`."""
    height, width, count = image.shape
    blocks = image.reshape(height // 2, 2, width // 2, 2, count)
    return blocks.transpose(0, 2, 1, 3, 4).reshape(height // 2, width // 2, 4 * count)


def unpack(x: jax.Array) -> jax.Array:
    """The inverse of `pack`."""
    h, w, count = x.shape
    blocks = x.reshape(h, w, 2, 2, count // 4).transpose(0, 2, 1, 3, 4)
    return blocks.reshape(2 * h, 2 * w, count // 4)


def _layer(params: Params, name: str, x: jax.Array, stride: int = 1) -> jax.Array:
    return _leaky(convolve(x, params[name], params[f"{name}_bias"], stride))


def _leaky(x: jax.Array) -> jax.Array:
    return jax.nn.leaky_relu(x, 0.1)
