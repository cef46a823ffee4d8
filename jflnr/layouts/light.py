"""Dividing by albedo and putting the picture together again, without losing anything."""

import numpy as np

# Below this albedo a channel's light is not taken from the channel itself: what is divided by it
# would be glossy reflection and rounding, a hundred times amplified.
DARK = 0.01


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
