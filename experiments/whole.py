"""Whole pictures of Cycles from few to many samples: ours beside Open Image Denoise."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, plots, results
from experiments.peers import oidn
from experiments.timing import interleaved
from jflnr.exr import read_channels
from jflnr.frame import Array, Frame
from jflnr.methods import PICTURES
from jflnr.metrics import display, exposure, flip, ssim, unbiased_mse

NAME = "whole"
QUESTION = "How near does a whole picture come to Open Image Denoise?"
MINUTES = 15

SAMPLES = 1, 4, 16, 64
SIZES = (360, 640), (1080, 1920)
REPEATS = 4


def folders() -> list[Path]:
    """Those of the data, and those that `rendering/blender.py` made."""
    roots = (data.folder().parent / "pictures", Path("cache") / "pictures")
    return [path.parent for root in roots for path in sorted(root.glob("*/4spp.exr"))]


def run(quick: bool) -> dict[str, Any]:
    """PSNR without the references' noise, SSIM and FLIP of every picture, by each method."""
    rows, films = [], []
    for folder in folders()[: 1 if quick else None]:
        halves = references(folder / "reference.exr")
        for spp in (4,) if quick else SAMPLES:
            if not (folder / f"{spp}spp.exr").exists():
                continue
            frame = jflnr.read_frame(folder / f"{spp}spp.exr")
            row: dict[str, Any] = {"spp": spp, "picture": folder.name}
            for name, image in images(frame).items():
                row |= {f"{name}_{key}": x for key, x in metrics(image, *halves).items()}
            said = (
                "  {picture}, {spp} spp: {ours_psnr:.2f}, {flnr_psnr:.2f}, OIDN {clean_psnr:.2f} dB"
            )
            print(said.format(**row))
            rows.append(row)
            if frame.alpha is not None:
                films.append({"spp": spp, "picture": folder.name} | films_of(frame, folder))
    rows.sort(key=lambda row: row["spp"])
    return {"pictures": [*rows, *means(rows)], "films": films, "times": times(quick)}


def films_of(frame: Frame, folder: Path) -> dict[str, float]:
    """PSNR of alpha without the noise of the references': noisy, ours, and OIDN's second pass."""
    halves = [half[..., 0] for half in references(folder / "reference.exr", "A")]
    alpha = np.asarray(frame.alpha)
    color, others = np.repeat(alpha, 3, axis=-1), auxiliaries(frame)
    films = {
        "noisy": alpha[..., 0],
        "ours": jflnr.denoise(frame, "picture")[..., 3],
        "raw": oidn.layers(color=color, **others)[..., 0],
        "clean": oidn.prefiltered(color, **others)[..., 0],
        "alone": oidn.layers(color=color)[..., 0],
    }
    psnr = lambda film: -10 * np.log10(unbiased_mse(np.asarray(film, np.float64), *halves))
    return {name: float(psnr(film)) for name, film in films.items()}


def times(quick: bool) -> list[dict[str, Any]]:
    """Seconds of a picture, repeated to each size, in OpenCL beside Open Image Denoise."""
    frame = jflnr.read_frame(folders()[0] / "4spp.exr")
    repeats, sizes = (1, SIZES[:1]) if quick else (REPEATS, SIZES)
    return [
        {"size": f"{w} x {h}"} | interleaved(calls(repeated(frame, h, w)), repeats)
        for h, w in sizes
    ]


def repeated(frame: Frame, height: int, width: int) -> Frame:
    """As often side by side as fills so many pixels."""
    down, across = (-(-n // m) for n, m in zip((height, width), frame.depth.shape, strict=False))
    return frame.map(lambda a: np.tile(a, (down, across, 1))[:height, :width].copy())


def calls(frame: Frame) -> dict[str, Callable[[], Any]]:
    """Ours on the device, without and with the network, and OIDN as in `images`."""
    ours = (functools.partial(jflnr.Denoiser(m, backend="opencl"), frame) for m in PICTURES)
    return {
        **dict(zip(("ours", "flnr"), ours, strict=True)),
        "raw": lambda: oidn.layers(color=frame.beauty, **auxiliaries(frame)),
        "clean": lambda: oidn.prefiltered(frame.beauty, **auxiliaries(frame)),
    }


def means(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Per number of samples."""
    found = []
    for spp in sorted({row["spp"] for row in rows}):
        same = [row for row in rows if row["spp"] == spp]
        numbers = {k: [r[k] for r in same] for k, x in same[0].items() if isinstance(x, float)}
        mean = {k: float(np.mean(x)) for k, x in numbers.items()}
        found.append({"spp": spp, "picture": f"mean of {len(same)}"} | mean)
    return found


def references(path: Path, names: str = "RGB") -> tuple[np.ndarray, np.ndarray]:
    """Two independent halves, of these channels."""
    channels = read_channels(path)
    whole, first = (
        np.stack([np.float64(channels[f"{name}.{c}"]) for c in names], axis=-1)
        for name in ("reference", "reference_a")
    )
    return first, 2 * whole - first


def images(frame: Frame) -> dict[str, Array]:
    """Noisy, ours without and with the network, and OIDN with auxiliaries as they are and
    prefiltered."""
    ours = (jflnr.denoise(frame, method)[..., :3] for method in PICTURES)
    return {
        "noisy": frame.beauty,
        **dict(zip(("ours", "flnr"), ours, strict=True)),
        "raw": oidn.layers(color=frame.beauty, **auxiliaries(frame)),
        "clean": oidn.prefiltered(frame.beauty, **auxiliaries(frame)),
    }


def auxiliaries(frame: Frame) -> dict[str, Any]:
    """What OIDN reads besides the colour."""
    return {"albedo": np.clip(np.asarray(frame.seen_albedo), 0, 1), "normal": frame.seen_normal}


def metrics(image: Array, first: np.ndarray, second: np.ndarray) -> dict[str, float | None]:
    """Of displayed pictures: PSNR in dB without the noise of the halves, SSIM and FLIP."""
    scale = exposure((first + second) / 2)
    shown, *halves = (display(np.asarray(x, np.float64), scale) for x in (image, first, second))
    wanted = display((first + second) / 2, scale)
    return {
        "psnr": float(-10 * np.log10(unbiased_mse(shown, *halves))),
        "ssim": ssim(shown, wanted),
        "flip": flip(shown, wanted),
    }


def draw(result: dict[str, Any], folder: Path) -> None:
    """A table of PSNR per picture, with SSIM and FLIP of ours with the network and the best."""
    columns = {
        "spp": "spp",
        "picture": "picture",
        "noisy_psnr": "noisy, dB",
        "ours_psnr": "picture",
        "flnr_psnr": "flnr-picture",
        "raw_psnr": "OIDN",
        "clean_psnr": "OIDN, auxiliaries prefiltered",
        "flnr_ssim": "SSIM, flnr-picture",
        "clean_ssim": "OIDN",
        "flnr_flip": "FLIP, flnr-picture",
        "clean_flip": "OIDN",
    }
    plots.write_text(folder / f"{NAME}.md", results.table(result["pictures"], columns))
