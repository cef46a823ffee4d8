"""A fair peer is a strong peer: the parameters of the peers, tuned on the validation frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from experiments import data, resume
from experiments.methods import Denoiser
from experiments.peers import atrous, bmfr, guided, svgf
from experiments.settings import oidn_settings
from jflnr.frame import Frame
from jflnr.metrics import display, exposure, psnr

NAME = "tune"
QUESTION = "Which parameters of the peers are best on the validation frames?"
MINUTES = 1

GUIDES = (("normal", "depth"), ("normal", "depth", "ao"))
# Where the search starts, and the values that each parameter takes in turn.
SEARCH: dict[str, tuple[Denoiser, Mapping[str, Any], dict[str, tuple[Any, ...]]]] = {
    "guided filter": (
        guided.denoise,
        guided.TUNED,
        {"guides": GUIDES, "radius": (16, 24, 36), "eps": (1e-3, 3e-3, 1e-2, 3e-2)},
    ),
    "fast guided filter": (
        guided.denoise,
        guided.FAST_TUNED,
        {"radius": (16, 24, 36), "eps": (1e-3, 3e-3, 1e-2, 3e-2), "subsample": (4, 8)},
    ),
    "a-trous": (
        atrous.denoise,
        atrous.TUNED,
        {"colour": (64, 1e3, 1e5), "normal": (0.25, 0.5, 1.0), "position": (0.05, 0.1, 0.3)},
    ),
    "SVGF, spatial": (
        svgf.denoise,
        svgf.TUNED,
        {"sigma_l": (16, 64, 1e3), "sigma_n": (2.0, 4.0, 8.0, 32.0), "sigma_z": (4.0, 16.0, 64.0)},
    ),
    "BMFR, one frame": (
        bmfr.denoise,
        bmfr.TUNED,
        {
            "block": (32, 64),
            "features": (
                ("normal", "position", "position2"),
                ("normal", "position"),
                ("normal", "position", "ao"),
            ),
            "noise": (0.01, 0.1),
        },
    ),
}


def run(quick: bool) -> dict[str, Any]:
    """One coordinate at a time, by the mean PSNR over the frames, at one sample per pixel.

    In the middle of each frame only, to save time.
    """
    paths = [data.SHIPPED] if quick else data.frames("val")
    frames = [middle(data.read(path)) for path in paths]
    names = ["fast guided filter"] if quick else list(SEARCH)

    def search(name: str) -> list[dict[str, Any]]:
        denoiser, start, grid = SEARCH[name]
        best, tried = dict(start), []
        found = mean_psnr(frames, denoiser, best)
        for key, values in grid.items():
            for value in values[:2] if quick else values:
                if value == best[key]:
                    continue
                trial = best | {key: value}
                score = mean_psnr(frames, denoiser, trial)
                tried.append({"peer": name, "parameters": str(trial), "psnr": score})
                if score > found:
                    best, found = trial, score
        return [*tried, {"peer": name, "parameters": f"best: {best}", "psnr": found}]

    tried = [
        row for rows in resume.rows(f"{NAME}{'-quick' * quick}", names, search) for row in rows
    ]
    oidn = [
        {"peer": m.name, "psnr": mean_psnr(frames, m.denoise, m.parameters)}
        for m in (oidn_settings()[:1] if quick else oidn_settings())
    ]
    return {"tried": tried, "OIDN": oidn}


def middle(frame: Frame) -> Frame:
    """The middle of the frame, half as wide and high."""
    height, width = frame.depth.shape[:2]
    rows, columns = (slice(size // 4, size // 4 + size // 2) for size in (height, width))
    return jax.tree.map(lambda layer: np.ascontiguousarray(layer[rows, columns]), frame)


def mean_psnr(frames: list[Frame], denoiser: Denoiser, parameters: Mapping[str, Any]) -> float:
    """Mean PSNR of the reflected light over the frames, dB."""
    return float(np.mean([quick_psnr(f, denoiser(f, **parameters)) for f in frames]))


def quick_psnr(frame: Frame, indirect: Any) -> float:
    """The PSNR of `jflnr.metrics.measure`, without the slower metrics."""
    albedo = np.asarray(frame.albedo, np.float64)
    y = albedo * np.asarray(frame.reference, np.float64)
    x = albedo * np.asarray(indirect, np.float64)
    scale = exposure(y)
    return psnr(display(x, scale), display(y, scale))
