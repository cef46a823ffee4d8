"""Blockwise multi-order feature regression: phase II of BMFR (Koskela et al. 2019, section 3.3)."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.frame import Array
from jflnr.regression.division import divide
from jflnr.regression.moments import unit_of

# Displacements of the grid, in blocks: a sequence of 16 (section 6.1), here spread evenly.
OFFSETS = np.arange(16)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]) % 1

# Squares that vary by less are those of two values, -1 and 1: what is left of them is rounding.
FLAT = 1e-3


def grid_offset(number: Any, block: int) -> jax.Array:
    """How far the first block of frame `number` lies above and left of the frame, `(2,)` pixels."""
    return jnp.asarray((OFFSETS * block).astype(np.int32))[number % len(OFFSETS)]


def fit(
    light: Array,
    features: Array,
    surface: Array,
    number: Any,
    offset: Any,
    *,
    block: int = 32,
    noise: float | jax.Array = 0.01,
    squares: int = 0,
) -> jax.Array:
    """Least squares of the light on the features in every block, evaluated on every pixel.

    The fit sees `T + N` (Eq. 7), the evaluation `T` (Eq. 6): 1, the features scaled to [-1, 1] in
    each block, and the squares of the last `squares` of those, scaled again. With 1 and the
    features these span what the squares of Eq. 8 do, and are better conditioned far from the
    origin.

    A pixel without a surface, or whose light is not finite, is a row of noise alone. Such rows keep
    the fit of a block well posed, however few pixels are left, and pull it towards 0 by
    `noise^2 / 3` each, which is nothing beside one pixel's 1.

    light: `(H, W, C)`. features: `(H, W, F)`. surface: `(H, W, 1)` boolean. number: of the frame,
    from which the noise follows. offset: `(2,)`, pixels by which the grid of blocks begins above
    and left of the frame, less than `block`; the frame is mirrored at its borders. block: pixels on
    a side. noise: half width of the uniform noise; without it a block whose features depend on each
    other, such as a plane, becomes NaN.
    Returns `(H, W, C)`, 0 where there is no surface.
    """
    height, width, channels = light.shape
    rows, columns = (
        mirrored(size, block, at) for size, at in zip((height, width), offset, strict=True)
    )
    cut = lambda image: jnp.asarray(image)[rows[:, None, :, None], columns[:, None, :]].reshape(
        len(rows) * len(columns), block * block, -1
    )
    surface = surface & jnp.all(jnp.isfinite(features), axis=-1, keepdims=True)
    # Sums over a block of light near the type's maximum must not overflow.
    unit = jnp.maximum(unit_of(jnp.asarray(light)), 1)
    there, z = cut(surface), cut(light / unit)
    t = scaled_features(cut(features), there, squares)
    used = there & jnp.all(jnp.isfinite(z), axis=-1, keepdims=True)
    matrix = jnp.concatenate([jnp.where(used, t, 0), jnp.where(used, z, 0)], axis=-1)
    count = t.shape[-1]
    jitter = noise * uniform(number, len(rows), len(columns), block, count)
    r = triangle(matrix.at[..., :count].add(jitter.astype(matrix.dtype)), count)
    alpha = jax.scipy.linalg.solve_triangular(r[..., :count], r[..., count:])
    fitted = (t @ alpha).reshape(len(rows), len(columns), block, block, channels)
    image = fitted.swapaxes(1, 2).reshape(len(rows) * block, len(columns) * block, channels)
    start = jnp.append(jnp.asarray(offset), 0)
    return jax.lax.dynamic_slice(image, start, light.shape) * unit


def mirrored(size: int, block: int, offset: Any) -> jax.Array:
    """The pixels of one line that each block covers, `(ceil(size / block) + 1, block)`.

    Outside the frame it is mirrored, the border itself repeated.
    """
    blocks = -(-size // block) + 1
    place = (jnp.arange(blocks * block) - offset) % (2 * size)
    return jnp.where(place < size, place, 2 * size - 1 - place).reshape(blocks, block)


def scaled_features(features: jax.Array, surface: jax.Array, squares: int) -> jax.Array:
    """`T` of Eq. 4 without noise: 1, the features and the squares of the last ones, in [-1, 1].

    features: `(B, W, F)`. surface: `(B, W, 1)`. Returns `(B, W, 1 + F + squares)`, 0 where there is
    no surface. What is constant over a block is 0.
    """

    def to_unit(t: jax.Array, least: float) -> jax.Array:
        # Halved, since the range between the type's extremes is beyond it.
        t, least = t / 2, least / 2
        low = jnp.min(jnp.where(surface, t, jnp.inf), axis=1, keepdims=True)
        high = jnp.max(jnp.where(surface, t, -jnp.inf), axis=1, keepdims=True)
        varies = surface & (high - low > least)
        return jnp.where(varies, 2 * divide(t - low, high - low, least) - 1, 0)

    t = to_unit(features, 0)
    squared = to_unit(t[..., t.shape[-1] - squares :] ** 2, FLAT)
    return jnp.concatenate([surface.astype(t.dtype), t, squared], axis=-1)


def triangle(matrix: jax.Array, count: int) -> jax.Array:
    """The first `count` rows of R in matrix = Q R, by Householder reflections.

    matrix: `(B, W, M)`. Returns `(B, count, M)`; what lies below the diagonal means nothing. Q is
    not needed (section 3.4).
    """

    def reflect(k: Any, matrix: jax.Array) -> jax.Array:
        row = jnp.arange(matrix.shape[1])
        first = jnp.where(row >= k, matrix[:, :, k], 0)
        pivot = -jnp.copysign(jnp.linalg.norm(first, axis=1), first[:, k])
        v = first - jnp.where(row == k, pivot[:, None], 0)
        scale = 2 / jnp.maximum(jnp.sum(v**2, axis=1), 1e-30)
        along = jnp.einsum("bw,bwm->bm", v, matrix) * scale[:, None]
        return matrix - v[:, :, None] * along[:, None]

    return jax.lax.fori_loop(0, count, reflect, matrix)[:, :count]


def uniform(number: Any, rows: int, columns: int, block: int, count: int) -> jax.Array:
    """Noise in [-1, 1) of frame `number`, the same to the bit as in kernels_cl/bmfr/hash.h.

    Returns `(rows columns, block^2, count)` float32: of every feature of every pixel of the grid.
    """
    pixels = rows * columns * block * block
    counter = jnp.arange(pixels * count, dtype=jnp.uint32).reshape(-1, block * block, count)
    bits = pcg(counter ^ pcg(jnp.asarray(number).astype(jnp.uint32)))
    return (bits >> 9).astype(jnp.float32) * jnp.float32(2**-22) - 1


def pcg(value: jax.Array) -> jax.Array:
    """The hash of Jarzynski and Olano (2020), "Hash Functions for GPU Rendering", of uint32."""
    state = value * jnp.uint32(747796405) + jnp.uint32(2891336453)
    word = ((state >> ((state >> 28) + 4)) ^ state) * jnp.uint32(277803737)
    return (word >> 22) ^ word
