"""Is the error that a denoised frame tells of itself the error it has?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

import jflnr
from experiments import data, plots
from experiments.data import has
from experiments.results import Parts

NAME = "error_map"
QUESTION = "Are 90 % of the pixels within the 90 % interval, and is the error where the map says?"
MINUTES = 3

COUNTS = (1, 4, 16)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Half the width of an interval of so many percent, in standard errors of a normal distribution.
INTERVALS = {50: 0.6745, 68: 0.9945, 80: 1.2816, 90: 1.6449, 95: 1.96}
BLOCK = 8


def run(quick: bool) -> Parts:
    """Coverage of the intervals and rank correlation over blocks, frame by frame."""
    paths = data.frames("val", "test")[: 1 if quick else None]
    rows = []
    for path in paths:
        for spp in COUNTS:
            if has(path, spp):
                rows.append({"frame": data.label(path), "spp": spp, **one(path, spp)})
                print(f"  {rows[-1]}", flush=True)
    return {"means": rows}


def one(path: Path, spp: int) -> dict[str, float]:
    """Share of the pixels in each interval, and Spearman's correlation over 8 x 8 blocks."""
    off, error, inside = errors(path, spp)
    row = {f"in {k} %": float(np.mean((off <= z * error)[inside])) for k, z in INTERVALS.items()}
    true, told, whole = (blocks(image) for image in (off**2, error**2, inside.astype(float)))
    return row | {
        "rank correlation": float(spearmanr(true[whole > 0.99], told[whole > 0.99]).statistic)
    }


def errors(path: Path, spp: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True error of the brightness, the standard error told, and where there is a surface."""
    frame = jflnr.read_frame(path, spp=spp)
    image, error = jflnr.denoise(frame, "flr-adaptive", with_error=True)
    off = np.abs((np.asarray(image) - frame.reference) @ LUMINANCE)
    return off, np.asarray(error)[..., 0], np.asarray(frame.mask)[..., 0] > 0


def blocks(image: np.ndarray) -> np.ndarray:
    """Means over blocks of 8 x 8 pixels, `(H, W)` to `(H // 8, W // 8)`."""
    height, width = (size // BLOCK for size in image.shape)
    image = image[: height * BLOCK, : width * BLOCK]
    return image.reshape(height, BLOCK, width, BLOCK).mean((1, 3))


def charts(parts: Parts, folder: Path) -> None:
    """How many pixels are in each interval."""
    with plots.figure(folder / f"{NAME}.png") as axis:
        _calibration(axis, parts["means"])


def _calibration(axis: Any, rows: list[dict[str, Any]]) -> None:
    wanted = list(INTERVALS)
    axis.plot(wanted, wanted, "--", color="grey", label="calibrated")
    for spp, style in zip(COUNTS, ("o-", "s-", "^-"), strict=True):
        mine = [row for row in rows if row["spp"] == spp]
        if mine:
            shares = [[100 * row[f"in {k} %"] for row in mine] for k in wanted]
            label = f"{spp} spp, mean and range"
            axis.plot(wanted, [np.mean(s) for s in shares], style, label=label)
            axis.fill_between(wanted, [min(s) for s in shares], [max(s) for s in shares], alpha=0.1)
    axis.set(xlabel="interval, %", ylabel="pixels inside, %")
    axis.legend(fontsize=8)
