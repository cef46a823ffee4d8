"""Is the error that a denoised frame tells of itself the error it has?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

import jflnr
from experiments import data, plots, results
from experiments.ablation import has

NAME = "error_map"
QUESTION = "Are 90 % of the pixels within the 90 % interval, and is the error where the map says?"
MINUTES = 3

COUNTS = (1, 4, 16)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Half the width of an interval of so many percent, in standard errors of a normal distribution.
INTERVALS = {50: 0.6745, 68: 0.9945, 80: 1.2816, 90: 1.6449, 95: 1.96}
BLOCK = 8
SHOWN = "classroom_0"


def run(quick: bool) -> dict[str, Any]:
    """Coverage of the intervals and rank correlation over blocks, frame by frame."""
    paths = data.frames("val", "test")[: 1 if quick else None]
    rows = []
    for path in paths:
        for spp in COUNTS:
            if has(path, spp):
                rows.append({"frame": data.label(path), "spp": spp, **one(path, spp)})
                print(f"  {rows[-1]}", flush=True)
    return {"rows": rows}


def one(path: Path, spp: int) -> dict[str, float]:
    """Share of the pixels in each interval, and Spearman's correlation over 8 x 8 blocks."""
    off, error, inside = errors(path, spp)
    row = {f"{k} %": float(np.mean((off <= z * error)[inside])) for k, z in INTERVALS.items()}
    true, told, whole = (blocks(image) for image in (off**2, error**2, inside.astype(float)))
    return row | {"rank": float(spearmanr(true[whole > 0.99], told[whole > 0.99]).statistic)}


def errors(path: Path, spp: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True error of the brightness, the standard error told, and where there is a surface."""
    frame = jflnr.read_frame(path, spp=spp)
    image, error = jflnr.denoise_with_error(frame)
    off = np.abs((np.asarray(image) - frame.reference) @ LUMINANCE)
    return off, np.asarray(error)[..., 0], np.asarray(frame.mask)[..., 0] > 0


def blocks(image: np.ndarray) -> np.ndarray:
    """Means over blocks of 8 x 8 pixels, `(H, W)` to `(H // 8, W // 8)`."""
    height, width = (size // BLOCK for size in image.shape)
    image = image[: height * BLOCK, : width * BLOCK]
    return image.reshape(height, BLOCK, width, BLOCK).mean((1, 3))


def draw(result: dict[str, Any], folder: Path) -> None:
    """error_map.png: calibration, and the two maps of one frame; error_map.md: all frames."""
    rows = result["rows"]
    names = {f"{k} %": f"in {k} %" for k in INTERVALS}
    columns = {"frame": "frame", "spp": "spp", **names, "rank": "rank correlation"}
    plots.write_text(folder / f"{NAME}.md", results.table(rows, columns))
    shown = next((path for path in data.frames("test") if path.stem == SHOWN), data.SHIPPED)
    off, error, inside = errors(shown, 1)
    with plots.figure(folder / f"{NAME}.png", columns=3) as (left, middle, right):
        _calibration(left, rows)
        top = float(np.quantile(error[inside], 0.99))
        for axis, image, title in ((middle, error, "told"), (right, off, "true")):
            axis.imshow(np.where(inside, image, 0), cmap="magma", vmin=0, vmax=top)
            axis.set(xticks=[], yticks=[], title=f"{title} error of {data.label(shown)}, 1 spp")
            axis.grid(False)


def _calibration(axis: Any, rows: list[dict[str, Any]]) -> None:
    wanted = list(INTERVALS)
    axis.plot(wanted, wanted, "--", color="grey", label="calibrated")
    for spp, style in zip(COUNTS, ("o-", "s-", "^-"), strict=True):
        mine = [row for row in rows if row["spp"] == spp]
        if mine:
            shares = [[100 * row[f"{k} %"] for row in mine] for k in wanted]
            label = f"{spp} spp, mean and range"
            axis.plot(wanted, [np.mean(s) for s in shares], style, label=label)
            axis.fill_between(wanted, [min(s) for s in shares], [max(s) for s in shares], alpha=0.1)
    axis.set(xlabel="interval, %", ylabel="pixels inside, %")
    axis.legend(fontsize=8)
