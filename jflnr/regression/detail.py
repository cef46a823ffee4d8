"""Detail of a picture that no guide shows, given back where it is more than noise.

What the fit leaves of the noisy picture is averaged along the edges of the fit. Noise alone would
leave there what the spread in each window tells; the share of what is left that exceeds it, over
the blocks nearby, is signal (the Wiener filter), and so much of the average is added.
"""

from __future__ import annotations

import numpy as np

from jflnr.frame import Array
from jflnr.images.guides import shrink
from jflnr.lazy import jax, jnp
from jflnr.regression.features import FARTHEST, average

# Side in pixels of the blocks on which signal is told from noise.
BLOCK = 16
# How far the logarithms of the fit may differ within a window, one standard deviation.
ALIKE = 0.15
# Of the mean brightness, what is dark: noise grows with the light above.
DARK = 0.1
# Windows of fewer pixels beyond the first tell no more of the noise than so many.
FEWEST = 0.3
# Pixels beyond one that its result depends on.
REACH = FARTHEST + 2 * BLOCK


def find_detail(noisy: Array, fitted: Array, weight: Array, unit: Array) -> jax.Array:
    """What the fitted picture lacks of the noisy one's detail, `(H, W, 3)`.

    noisy, fitted: `(H, W, 3)`. weight: `(H, W)`, how much each pixel counts, 0 to 1; one that is
    not finite does not. unit: mean brightness of the picture, `(1, 1, 1)` or of its size.
    """
    unit = jnp.maximum(unit[..., 0], 1e-12)
    noisy, fitted = (jnp.moveaxis(jnp.asarray(a), -1, 0) for a in (noisy, fitted))
    scale = jnp.mean(fitted, axis=0) + DARK * unit
    left = (noisy - fitted) / scale
    usable = jnp.all(jnp.isfinite(left), axis=0)
    left = jnp.where(usable, left * weight, 0)
    follow = jnp.concatenate([left, jnp.mean(left**2, axis=0, keepdims=True)])
    steer = jnp.where(usable, jnp.log1p(fitted / unit), 0)
    number, averages = average(steer, follow, usable, ALIKE)
    detail, square = averages[:3], averages[3]
    signal = jnp.mean(detail**2, axis=0)
    noise = jnp.maximum(square - signal, 0) / jnp.maximum(number - 1, FEWEST)
    found = shrink(jnp.stack([signal, signal - noise], axis=-1), BLOCK)
    share = jnp.maximum(found[..., 1], 0) / jnp.maximum(found[..., 0], 1e-30)
    return jnp.moveaxis(enlarge(share, BLOCK, usable.shape) * detail * scale, 0, -1)


def enlarge(blocks: jax.Array, block: int, size: tuple[int, ...]) -> jax.Array:
    """Blocks `(h, w)` interpolated bilinearly between their centres, to `size` pixels."""
    for axis, (count, last) in enumerate(zip(size, blocks.shape, strict=True)):
        place = np.clip((np.arange(count) + 0.5) / block - 0.5, 0, last - 1)
        before = np.minimum(place.astype(int), max(last - 2, 0))
        t = (place - before).astype(np.float32).reshape((-1, 1) if axis == 0 else (1, -1))
        first = jnp.take(blocks, before, axis=axis)
        second = jnp.take(blocks, np.minimum(before + 1, last - 1), axis=axis)
        blocks = first + t * (second - first)
    return blocks
