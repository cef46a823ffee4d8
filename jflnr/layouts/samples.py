"""How many samples per pixel a picture's layers are means of: as told, or by what its edges show.

Where one surface ends before another, a pixel's mean of n samples is a mixture of the two in n-ths.
"""

from __future__ import annotations

import re
from typing import TypeAlias

import numpy as np

from jflnr.exr import Attributes
from jflnr.layouts.channels import Layout
from jflnr.layouts.source import Source

# More than MOST are not told apart; FEWEST pixels that are mixtures are a sign.
MOST, FEWEST = 64, 8
# What a share may be off by; how far shares must agree above chance with a number, and with the
# least number against the best one, whose multiples agree as well.
OFF, AGREE, ALMOST = 0.003, 0.4, 0.7
# Pixels beside one that tell whether it lies between two flat surfaces, on both sides together.
AROUND = 4

Shares: TypeAlias = tuple[np.ndarray, np.ndarray]


def samples_of(
    source: Source, normal: np.ndarray, albedo: np.ndarray, alpha: np.ndarray | None
) -> int | None:
    """Samples per pixel; 0 of a path tracer that neither says nor shows it, None for layers that
    may be of the pixels' centres.

    normal, albedo: `(H, W, 3)`. alpha: `(H, W, 1)`.
    """
    if (told := told_samples(source.layout, source.attributes)) is not None:
        return told
    if source.layout.program != "Blender":
        return None
    return count_samples(*(source.shares or shares_of(normal, albedo, alpha)))


def told_samples(layout: Layout, attributes: Attributes) -> int | None:
    """Samples per pixel as the file's header or names tell them."""
    if layout.program == "jflnr":
        own = re.fullmatch(r"beauty_(\d+)\.R", layout.channels["beauty"][0])
        return int(own[1]) if own else None
    for name, value in attributes.others.items():
        if name == "samplesPerPixel" or re.fullmatch(r"cycles\..*\.samples", name):
            return int(value) if str(value).isdigit() else None
    return None


def count_samples(turned: np.ndarray, others: np.ndarray) -> int:
    """Samples per pixel by what `shares_of` finds; 0 if that is too little."""
    shares, counts = np.append(turned, others)[:, None], np.arange(2, MOST + 1)
    if len(shares) < FEWEST:
        return 0
    near = np.abs(shares * counts - np.round(shares * counts)) < OFF * counts
    agree = 1 - np.mean(~near, axis=0) / (1 - 2 * OFF * counts)
    if (best := agree.max()) > AGREE:
        return int(counts[np.argmax(agree > ALMOST * best)])
    # What is no share of whole samples may be a texture or glass, but is not in the normals.
    return MOST if len(turned) >= FEWEST else 0


def shares_of(
    normal: np.ndarray, albedo: np.ndarray, alpha: np.ndarray | None, rows: int | None = None
) -> Shares:
    """How much of one surface is in pixels between two flat ones, by their normals; and by their
    albedo, and of any in pixels that are covered in part: `(N,)` each.

    rows: only of the first so many, and down from them.
    """
    turned, painted = (
        np.append(_mixed(layer[:rows]), _mixed(np.swapaxes(layer, 0, 1)))
        for layer in (normal, albedo)
    )
    covered = np.zeros(0) if alpha is None else alpha[:rows].ravel()
    return turned, np.append(painted, covered[(covered > OFF) & (covered < 1 - OFF)])


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def _mixed(layer: np.ndarray) -> np.ndarray:
    before, left, pixel, right, after = (layer[:, i : i - AROUND or None] for i in range(5))
    across = left - right
    square = np.sum(across**2, axis=-1)
    share = np.sum((pixel - right) * across, axis=-1) / square
    rest = np.sum((pixel - right - share[..., None] * across) ** 2, axis=-1)
    bend = [np.sum((a - b) ** 2, axis=-1) for a, b in ((before, left), (right, after))]
    flat = (square > 0.05) & (np.maximum(*bend) < 1e-5) & (rest < 1e-5 * square)
    return share[flat & (share > OFF) & (share < 1 - OFF)]
