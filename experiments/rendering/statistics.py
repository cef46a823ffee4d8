"""Statistics of 1-spp frames: what tells one kind of noise and light from another."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jflnr.exr import layers_of, read_attributes, read_channels

MEASURES = {
    "lit": "share of lit pixels",
    "variance": "relative variance",
    "kurtosis": "excess kurtosis of the noise",
    "contrast": "contrast of the reference",
}
EXPOSED = 1e-6


def measure(noisy: NDArray[np.floating], reference: NDArray[np.floating]) -> dict[str, float]:
    """Of one 1-spp layer and its reference, both luminances `(N,)` inside the mask.

    `lit`: share of pixels that are not black; `variance`: mean squared error over the squared
    mean; `kurtosis`: of the error in units of the mean; `contrast`: deviation of the reference
    over its mean.
    """
    mean = max(float(reference.mean()), 1e-12)
    error = (noisy - reference) / mean
    centred = error - error.mean()
    variance = float((centred**2).mean())
    return {
        "lit": float((noisy > EXPOSED * mean).mean()),
        "variance": float((error**2).mean()),
        "kurtosis": float((centred**4).mean() / variance**2 - 3),
        "contrast": float(reference.std() / mean),
    }


def measure_file(path: Path) -> tuple[str, list[dict[str, float]]]:
    """The scene of a frame and the statistics of each of its 1-spp layers."""
    channels = read_channels(path)
    scene = json.loads(read_attributes(path).comments)["scene"]
    mask = channels["mask.Y"].astype(float) > 0

    def luminance(layer: str) -> NDArray[np.floating]:
        return np.mean([channels[f"{layer}.{c}"].astype(float)[mask] for c in "RGB"], axis=0)

    names = [n for n in layers_of(channels) if n == "indirect_1" or n.startswith("indirect_1_")]
    reference = luminance("reference")
    return scene, [measure(luminance(name), reference) for name in names]


def covered(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Share of `theirs` that lies within the range of `ours`."""
    low, high = min(ours), max(ours)
    return float(np.mean([low <= value <= high for value in theirs]))
