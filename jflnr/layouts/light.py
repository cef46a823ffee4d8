"""Dividing by albedo and putting the picture together again, without losing anything.

And how many pixels of it are denoised.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

# Below this albedo a channel's light is not taken from the channel itself: what is divided by it
# would be glossy reflection and rounding, a hundred times amplified.
DARK = 0.01
# Farther than anything: programs write 1e10 or infinity where nothing is hit.
SKY = 1e9


@np.errstate(invalid="ignore", over="ignore")
def demodulate(radiance: np.ndarray, albedo: np.ndarray) -> np.ndarray:
    """The light that `albedo` reflects as `radiance`, both (H, W, 3).

    A channel whose albedo is at most `DARK` gets the mean light of the pixel's other channels, so
    that a saturated surface does not darken its neighbours; 0 if all three are.
    """
    bright = albedo > DARK
    light = np.divide(radiance, albedo, out=np.zeros_like(radiance), where=bright)
    mean = light.sum(axis=-1, keepdims=True) / np.maximum(bright.sum(axis=-1, keepdims=True), 1)
    return np.where(bright, light, mean)


@np.errstate(invalid="ignore", over="ignore")
def rest(picture: np.ndarray, albedo: np.ndarray, light: np.ndarray) -> np.ndarray:
    """What `picture` holds besides `albedo * light`: glossy, transmitted, emitted light, sky.

    0 where that product is NaN or infinite: there the denoised light stands in for the picture.
    """
    reflected = np.where(albedo > 0, albedo * light, 0)
    return np.where(np.isfinite(reflected), picture - reflected, 0)


def denoised(images: Mapping[str, Any], whole: bool) -> tuple[int, str]:
    """The number of pixels that are denoised, and a sentence that says why if there are none.

    images: the layers of a frame, (H, W, C) or None. whole: whether it is denoised as a picture,
    whose mask does not count and whose guides without a number are those of their neighbours.
    """
    finite = lambda name: whole | np.isfinite(images[name]).all(axis=-1)
    depth, mask = np.asarray(images["depth"])[..., 0], None if whole else images["mask"]
    seen = (depth > 0) & (depth < SKY) if mask is None else np.asarray(mask)[..., 0] > 0
    guides = seen & finite("normal") & finite("depth")
    if not seen.any() and not ((depth > 0) & (depth < SKY)).any():
        why = f"its depth is nowhere between 0 and {SKY:g}"
    elif not seen.any():
        why = f"its mask is 0, or its albedo {DARK} or less, wherever it has a depth"
    elif not guides.any():
        why = "normal or depth is NaN or infinite wherever there is a surface"
    else:
        why = ""
    return int(guides.sum()), why and f"nothing is denoised, as no pixel has a surface: {why}"
