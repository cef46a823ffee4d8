"""The picture of the README: the shipped frame noisy, denoised and converged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from skimage.io import imsave

import jflnr
from experiments import data
from jflnr.files import replacing
from jflnr.metrics import display, exposure, measure

NAME = "picture"
METHODS = ("flr", "flr-adaptive", "flnr")
QUESTION = "What does one sample per pixel look like before and after?"
MINUTES = 1


def run(quick: bool) -> dict[str, Any]:
    """PSNR and SSIM of the shipped frame, noisy and by each method."""
    frame = jflnr.read_frame(data.SHIPPED)
    images = {"noisy": frame.indirect} | {m: jflnr.denoise(frame, m) for m in METHODS}
    return {name: measure(frame, np.asarray(image)) for name, image in images.items()}


def draw(result: dict[str, Any], folder: Path) -> None:
    """room.png: noisy, the last method of the list, reference, side by side."""
    frame = jflnr.read_frame(data.SHIPPED)
    assert frame.reference is not None
    method = list(result)[-1]
    lights = (frame.indirect, np.asarray(jflnr.denoise(frame, method)), frame.reference)
    pictures = [np.asarray(jflnr.composite(frame, light)) for light in lights]
    # Exposed for what reflects: the sky in the window would darken the room.
    scale = exposure(pictures[2] - np.asarray(frame.emission))
    shown = np.concatenate([display(picture, scale) for picture in pictures], axis=1)
    with replacing(folder / "room.png") as beside:
        imsave(beside, np.uint8(np.round(255 * shown)), check_contrast=False)
