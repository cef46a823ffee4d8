"""What FLR brings over the paper's basic algorithm (its Figure 3), on real frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import correlate1d

import jflnr
from experiments import data, plots, results
from jflnr.guides import layers
from jflnr.metrics import measure

NAME = "gain"
QUESTION = "How much better than the paper's Figure 3 is FLR, frame by frame?"
MINUTES = 1

KERNEL, STD, TIKHONOV = 41, 10.0, 1e-6


def run(quick: bool) -> dict[str, Any]:
    """PSNR and SSIM of the noisy input, Figure 3 and `flr`, on the val and test frames."""
    rows = []
    for path in data.frames("val", "test")[: 1 if quick else None]:
        frame = jflnr.read_frame(path)
        images = {
            "noisy": np.asarray(frame.indirect),
            "figure3": figure3(frame),
            "flr": np.asarray(jflnr.denoise(frame)),
        }
        row: dict[str, Any] = {"frame": data.label(path)}
        for name, image in images.items():
            measured = measure(frame, image)
            row |= {f"{name}_psnr": measured["psnr"], f"{name}_ssim": measured["ssim"]}
        row["gain"] = row["flr_psnr"] - row["figure3_psnr"]
        print("  {frame}: {figure3_psnr:.2f} -> {flr_psnr:.2f} dB".format(**row), flush=True)
        rows.append(row)
    keys = [key for key in rows[0] if key != "frame"]
    rows.append({"frame": "mean"} | {k: float(np.mean([r[k] for r in rows])) for k in keys})
    return {"frames": rows}


def figure3(frame: jflnr.Frame) -> np.ndarray:
    """The paper's Figure 3 in numpy float64: per-pixel model, Gaussian window, Tikhonov.

    Independent of jflnr's own regression. Returns `(H, W, 3)`.
    """
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


def draw(result: dict[str, Any], folder: Path) -> None:
    """A table of PSNR per frame."""
    columns = {
        "frame": "frame",
        "noisy_psnr": "noisy",
        "figure3_psnr": "Figure 3",
        "flr_psnr": "FLR",
        "gain": "gain, dB",
    }
    text = results.table(result["frames"], columns)
    plots.write_text(folder / f"{NAME}.md", text)
