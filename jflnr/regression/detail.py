"""Detail of a picture that no guide shows, given back where it is more than noise.

What the fit leaves of the noisy picture is averaged along the edges of the fit. Noise alone would
leave there what the spread in each window tells; the share of what is left that exceeds it, over
the blocks nearby, is signal (the Wiener filter), and so much of the average is added.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jflnr.frame import Array
from jflnr.images.guides import shrink
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


def find_detail(
    noisy: Array,
    fitted: Array,
    weight: Array,
    unit: Array,
    average: Callable[..., Any] = average,
) -> Array:
    """What the fitted picture lacks of the noisy one's detail, `(H, W, 3)`.

    noisy, fitted: `(H, W, 3)`. weight: `(H, W)`, how much each pixel counts, 0 to 1; one that is
    not finite does not. unit: mean brightness of the picture, `(1, 1, 1)` or of its size. average:
    `features.average`, or that of a device.
    """
    xp: Any = fitted.__array_namespace__()
    unit = xp.maximum(unit[..., 0], 1e-12)
    noisy, fitted = (xp.stack([a[..., c] for c in range(3)]) for a in (noisy, fitted))
    scale = xp.mean(fitted, axis=0) + DARK * unit
    left = (noisy - fitted) / scale
    usable = xp.all(xp.isfinite(left), axis=0)
    left = xp.where(usable, left * weight, 0)
    follow = xp.concatenate([left, xp.mean(left**2, axis=0, keepdims=True)])
    steer = xp.where(usable, xp.log1p(fitted / unit), 0)
    number, averages = average(steer, follow, usable, ALIKE)
    detail, square = averages[:3], averages[3]
    signal = xp.mean(detail**2, axis=0)
    noise = xp.maximum(square - signal, 0) / xp.maximum(number - 1, FEWEST)
    found = shrink(xp.stack([signal, signal - noise], axis=-1), BLOCK)
    share = xp.maximum(found[..., 1], 0) / xp.maximum(found[..., 0], 1e-30)
    return xp.moveaxis(enlarge(share, BLOCK, usable.shape) * detail * scale, 0, -1)


def enlarge(blocks: Array, block: int, size: tuple[int, int]) -> Array:
    """Blocks `(h, w)` interpolated bilinearly between their centres, to `size` pixels."""
    xp: Any = blocks.__array_namespace__()
    for axis, (count, last) in enumerate(zip(size, blocks.shape, strict=True)):
        place = np.clip((np.arange(count) + 0.5) / block - 0.5, 0, last - 1)
        before = np.minimum(place.astype(int), max(last - 2, 0))
        t = (place - before).astype(np.float32).reshape((-1, 1) if axis == 0 else (1, -1))
        first = xp.take(blocks, before, axis=axis)
        second = xp.take(blocks, np.minimum(before + 1, last - 1), axis=axis)
        blocks = first + t * (second - first)
    return blocks
