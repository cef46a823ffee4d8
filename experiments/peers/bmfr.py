"""Blockwise Multi-Order Feature Regression (Koskela et al. 2019), its single-frame form.

No temporal accumulation and no TAA: blocks of 32 x 32 pixels, the ten features of Eq. 8,
Householder QR of [T + N, z] with the noise N of Eq. 7.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from jflnr.frame import Array, Frame
from jflnr.guides import layers

PAPER: dict[str, Any] = {
    "features": ("normal", "position", "position2"),
    "block": 32,
    "noise": 0.01,
    "grids": 1,
}
TUNED: dict[str, Any] = {"features": ("normal", "position"), "block": 64, "noise": 0.1, "grids": 4}


def denoise(
    frame: Frame, *, features: tuple[str, ...], block: int, noise: float, grids: int, seed: int = 0
) -> Array:
    """Least squares in every block on noisy features, evaluated on the clean ones (section 3.4).

    features: layers of the frame; `position2` is the position squared after scaling, which with 1
    and the position spans what Eq. 8 does and is better conditioned. block: pixels on a side.
    noise: half width of the uniform noise on features scaled to [-1, 1]. grids: how many displaced
    grids of blocks are averaged; the paper displaces one grid per frame and averages over time.
    Returns `(H, W, 3)`.
    """
    return _denoise(frame, features, block, noise, grids, seed)


@functools.partial(jax.jit, static_argnames=("features", "block", "grids"))
def _denoise(
    frame: Frame, features: tuple[str, ...], block: int, noise: float, grids: int, seed: int
) -> jax.Array:
    names = [name for name in features if name != "position2"]
    parts = dict(zip(names, layers(frame, names), strict=True))
    if "position2" in features:
        parts["position2"] = layers(frame, ("position",))[0]
    squared = [name == "position2" for name in parts for _ in range(parts[name].shape[-1])]
    x = jnp.concatenate(list(parts.values()), axis=-1)
    y = jnp.asarray(frame.indirect)
    total = jnp.zeros_like(y)
    for grid in range(grids):
        # Displacements along a diagonal and its mirror: (0, 0), (1/2, 1/2), (1/4, 3/4), ...
        place = [0.0, 0.5, 0.25, 0.75][grid % 4] * block
        offset = (int(place), int(block - place) % block)
        key = jax.random.fold_in(jax.random.key(seed), grid)
        total += fit(y, x, jnp.asarray(squared), block, noise, offset, key)
    return jnp.maximum(total / grids, 0)


def fit(
    y: jax.Array,
    x: jax.Array,
    squared: jax.Array,
    block: int,
    noise: float,
    offset: tuple[int, int],
    key: jax.Array,
) -> jax.Array:
    """One grid of blocks, its first corner `offset` pixels outside the frame."""
    height, width, channels = y.shape
    blocks = _cut(jnp.concatenate([x, y], axis=-1), block, offset)
    t, z = _scaled(blocks[..., : x.shape[-1]], squared), blocks[..., x.shape[-1] :]
    t = jnp.concatenate([jnp.ones_like(t[..., :1]), t], axis=-1)
    jitter = jax.random.uniform(key, t.shape, t.dtype, -noise, noise)
    r = triangle(jnp.concatenate([t + jitter, z], axis=-1), t.shape[-1])
    alpha = jax.scipy.linalg.solve_triangular(r[..., : t.shape[-1]], r[..., t.shape[-1] :])
    fitted = t @ alpha
    rows, columns = (
        -(-(size + o) // block) for size, o in zip((height, width), offset, strict=True)
    )
    image = fitted.reshape(rows, columns, block, block, channels).swapaxes(1, 2)
    image = image.reshape(rows * block, columns * block, channels)
    return image[offset[0] :, offset[1] :][:height, :width]


def triangle(matrix: jax.Array, count: int) -> jax.Array:
    """The first `count` rows of R in matrix = Q R, by Householder reflections.

    matrix: `(B, W, M)`. Returns `(B, count, M)`. Q is not needed (section 3.4).
    """
    rows: list[jax.Array] = []
    for _ in range(count):
        first = matrix[:, :, 0]
        norm = jnp.linalg.norm(first, axis=1)
        pivot = -jnp.copysign(norm, first[:, 0])
        v = first.at[:, 0].add(-pivot)
        scale = 2 / jnp.maximum(jnp.sum(v**2, axis=1), 1e-30)
        along = jnp.einsum("bw,bwm->bm", v, matrix) * scale[:, None]
        matrix = matrix - v[:, :, None] * along[:, None]
        rows.append(jnp.pad(matrix[:, 0], ((0, 0), (len(rows), 0))))
        matrix = matrix[:, 1:, 1:]
    return jnp.stack(rows, axis=1)


def _cut(image: jax.Array, block: int, offset: tuple[int, int]) -> jax.Array:
    """Blocks `(B, block^2, C)`; the frame is mirrored at its border, as the authors' code does."""
    margins = [(o, -(size + o) % block) for size, o in zip(image.shape[:2], offset, strict=True)]
    image = jnp.pad(image, [*margins, (0, 0)], mode="symmetric")
    rows, columns = image.shape[0] // block, image.shape[1] // block
    cut = image.reshape(rows, block, columns, block, -1).swapaxes(1, 2)
    return cut.reshape(rows * columns, block * block, -1)


def _scaled(t: jax.Array, squared: jax.Array) -> jax.Array:
    """Each feature of each block scaled to [-1, 1]; the squared ones are squared, then scaled."""

    def to_unit(t: jax.Array) -> jax.Array:
        low, high = t.min(1, keepdims=True), t.max(1, keepdims=True)
        return jnp.where(high > low, 2 * (t - low) / jnp.maximum(high - low, 1e-12) - 1, 0)

    return to_unit(jnp.where(squared, to_unit(t) ** 2, t))
