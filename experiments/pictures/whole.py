"""The picture of the README: one of Cycles noisy, denoised, by Open Image Denoise, converged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from skimage.io import imsave

import jflnr
from experiments import data, whole
from jflnr.files import replacing
from jflnr.metrics import display, exposure

SAMPLES = 4


def draw(folder: Path) -> None:
    """whole.jpg: above noisy and ours, below Open Image Denoise and the reference."""
    source = data.folder().parent / "pictures" / "living"
    frame = jflnr.read_frame(source / f"{SAMPLES}spp.exr")
    reference = np.mean(whole.references(source / "reference.exr"), axis=0)
    others = whole.images(frame)
    rows = (frame.beauty, others["flnr"]), (others["clean"], reference)
    scale = exposure(reference)
    shown = [np.concatenate([display(np.asarray(x), scale) for x in row], axis=1) for row in rows]
    with replacing(folder / "whole.jpg") as beside:
        pixels = np.uint8(np.round(255 * np.concatenate(shown)))
        imsave(beside, pixels, check_contrast=False, quality=92)
