"""The basic algorithm of the paper's Figure 3, independent of jflnr's own regression."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import correlate1d

from jflnr.frame import Frame
from jflnr.images.guides import layers

KERNEL, STD, TIKHONOV = 41, 10.0, 1e-6


def denoise(frame: Frame) -> np.ndarray:
    """In numpy float64: per-pixel model, Gaussian window, Tikhonov. Returns `(H, W, 3)`."""
    guides = [np.asarray(a, np.float64) for a in layers(frame, ("normal", "depth", "ao"))]
    height, width = guides[0].shape[:2]
    x = np.concatenate([np.ones((height, width, 1)), *guides], axis=-1)
    y = np.asarray(frame.indirect, np.float64)
    xx = _window(x[..., :, None] * x[..., None, :]) + TIKHONOV * np.eye(x.shape[-1])
    xy = _window(x[..., :, None] * y[..., None, :])
    return np.einsum("hwi,hwic->hwc", x, np.linalg.solve(xx, xy))


def _window(image: np.ndarray) -> np.ndarray:
    """torchvision's GaussianBlur: 41 taps, reflected borders."""
    offsets = np.arange(KERNEL) - KERNEL // 2
    taps = np.exp(-0.5 * (offsets / STD) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        image = correlate1d(image, taps, axis=axis, mode="mirror")
    return image
