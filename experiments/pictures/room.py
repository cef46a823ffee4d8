"""The picture of the README: the shipped frame noisy, denoised and converged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from skimage.io import imsave

import jflnr
from experiments import data
from jflnr.files import replacing
from jflnr.metrics import display, exposure


def draw(folder: Path) -> None:
    """room.png: noisy, by flnr, reference, side by side."""
    frame = jflnr.read_frame(data.SHIPPED)
    lights = (frame.indirect, np.asarray(jflnr.denoise(frame, "flnr")), frame.reference)
    pictures = [np.asarray(jflnr.composite(frame, np.asarray(light))) for light in lights]
    # Exposed for what reflects: the sky in the window would darken the room.
    scale = exposure(pictures[2] - np.asarray(frame.emission))
    shown = np.concatenate([display(picture, scale) for picture in pictures], axis=1)
    with replacing(folder / "room.png") as beside:
        imsave(beside, np.uint8(np.round(255 * shown)), check_contrast=False)
