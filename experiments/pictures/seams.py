"""Whether a seam shows where pieces of a frame meet."""

from __future__ import annotations

from pathlib import Path

import jax
import matplotlib.pyplot as plt
import numpy as np

import jflnr
from experiments import data
from jflnr.files import replacing
from jflnr.metrics import display, exposure


def draw(folder: Path) -> None:
    """large_seams.png: whole, in pieces, in strips that know nothing of each other; differences."""
    frame = jflnr.read_frame(data.SHIPPED)
    whole = np.asarray(jflnr.denoise(frame))
    rows = 48
    apart = [
        jflnr.denoise(jax.tree.map(lambda a, top=top: a[top : top + rows], frame))
        for top in range(0, whole.shape[0], rows)
    ]
    tile = int((rows * whole.shape[1]) ** 0.5)
    pictures = {
        "whole": whole,
        f"in pieces (tile={tile})": np.asarray(jflnr.denoise(frame, tile=tile)),
        "strips apart: what a seam is": np.concatenate(apart),
    }
    scale = exposure(whole * frame.albedo)
    drawing, axes = plt.subplots(2, 3, figsize=(12, 5), layout="constrained")
    for (top, bottom), (name, light) in zip(axes.T, pictures.items(), strict=True):
        top.imshow(display(light * frame.albedo, scale))
        difference = np.abs(light - whole).mean(axis=-1) / whole.mean()
        bottom.imshow(difference, vmin=0, vmax=0.02, cmap="gray")
        top.set(title=name, xticks=[], yticks=[])
        text = f"difference: at most {difference.max():.1g} of the mean (white: 0.02)"
        bottom.set(xlabel=text, xticks=[], yticks=[])
    with replacing(folder / "large_seams.png") as beside:
        drawing.savefig(beside, dpi=80, format="png")
    plt.close(drawing)
