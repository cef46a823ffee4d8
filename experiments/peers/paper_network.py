"""FLNR exactly as in section 3.3 of the paper: a U-Net at full resolution that makes the guides.

From the guides and the noisy light it makes two sets of Q guides: the model is fitted to the first,
X_model, and evaluated on the second, X_map.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jflnr.network.unet import Params, convolve, layers, upsample
from jflnr.regression.flr import FLR, flr


def init(key: jax.Array, inputs: int, guides: int, widths: Sequence[int] = (16, 32, 64)) -> Params:
    """Random weights (He et al. 2015). widths: channels at full resolution, at half of it, ..."""
    first, last = widths[0], len(widths) - 1
    shapes = {"in3": (3, 3, inputs, first), "in1": (1, 1, first, first)}
    for i in range(last):
        shapes[f"encode{i}a"] = (3, 3, widths[i], widths[i])
        shapes[f"encode{i}b"] = (3, 3, widths[i], widths[i + 1])
        shapes[f"decode{i}a"] = (3, 3, widths[i] + widths[i + 1], widths[i])
        shapes[f"decode{i}b"] = (3, 3, widths[i], widths[i])
    shapes |= {"out3": (3, 3, first, first), "out1": (1, 1, first, 2 * guides)}
    return layers(key, shapes)


def apply(params: Params, x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """X_model and X_map, `(H, W, Q)` each, between 0 and 1. x: `(H, W, inputs)`, any size."""

    def layer(name: str, x: jax.Array, stride: int = 1) -> jax.Array:
        return convolve(x, params[name], params[f"{name}_bias"], stride)

    scales = sum(name.startswith("encode") and name.endswith("a") for name in params)
    x = layer("in1", layer("in3", x))
    skips = []
    for i in range(scales):
        skips.append(x)
        x = jax.nn.leaky_relu(layer(f"encode{i}b", layer(f"encode{i}a", x), stride=2))
    for i in reversed(range(scales)):
        x = jnp.concatenate([upsample(x, *skips[i].shape[:2]), skips[i]], axis=-1)
        x = jax.nn.leaky_relu(layer(f"decode{i}b", layer(f"decode{i}a", x)))
    model, mapped = jnp.split(jax.nn.sigmoid(layer("out1", layer("out3", x))), 2, axis=-1)
    return model, mapped


def flnr_of_paper(
    target: jax.Array,
    guides: jax.Array,
    params: Params,
    method: FLR,
    *,
    weight: jax.Array | None = None,
    **options: Any,
) -> jax.Array:
    """Denoise with the network's guides. Scales with `target`.

    The network reads the light as the logarithm of one plus its ratio to the frame's mean.

    target: `(H, W, C)`. guides: `(H, W, Q)`. params: from `init` with Q + C inputs. method,
    weight, options: as for `flr`. Returns `(H, W, C)`.
    """
    usable = (
        jnp.isfinite(target) if weight is None else jnp.isfinite(target) & (weight > 0)[..., None]
    )
    light = jnp.where(usable, target, 0)
    mean = jnp.sum(light) / jnp.maximum(jnp.sum(usable), 1)
    light = jnp.log1p(light / jnp.where(mean > 0, mean, 1))
    read = jnp.concatenate([jnp.nan_to_num(guides), light], axis=-1)
    model, mapped = apply(params, read)
    return flr(target, model, method, guides_map=mapped, weight=weight, **options)
