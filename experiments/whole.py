"""Whole pictures of Cycles from few to many samples: ours beside Open Image Denoise."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter

import jflnr
from experiments import data
from experiments.peers import oidn
from experiments.timing import interleaved
from jflnr.exr import read_channels
from jflnr.frame import Array, Frame
from jflnr.methods import PICTURES
from jflnr.metrics import display, exposure, flip, ssim
from jflnr.temporal.flicker import warped_error

NAME = "whole"
QUESTION = "How near does a whole picture come to Open Image Denoise?"
MINUTES = 15

SAMPLES = 1, 4, 16, 64
SIZES = (360, 640), (1080, 1920)
REPEATS = 4
SHOTS = Path("cache") / "shots"


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
    rows = [*rows, *means(rows)]
    moving = [row for path in sorted(SHOTS.glob("*/000.exr")) for row in shot(path.parent)]
    return {"pictures": rows, "films": films, "shots": moving, "times": times(quick)}


def shot(folder: Path) -> list[dict[str, Any]]:
    """By method: how much a shot flickers along its surfaces, and PSNR without the references'
    noise, of all and of what is seen in mirrors and glass."""
    frames = [jflnr.read_frame(path) for path in sorted(folder.glob("*.exr"))]
    paths = {int(path.stem): path for path in sorted((folder / "references").glob("*.exr"))}
    halves = {number: references(path) for number, path in paths.items()}
    scale = exposure(np.stack([(a + b) / 2 for a, b in halves.values()]))
    rows = []
    for name, images in over_time(frames):
        pairs = itertools.pairwise(zip(frames, images, strict=True))
        changes = [warped_error((f, g), (a, b), scale) for (f, a), (g, b) in pairs]
        errors = {n: squares(*shown(scale, images[n], *both)) for n, both in halves.items()}
        mirrored = np.concatenate([error[mirrors(frames[n])] for n, error in errors.items()])
        rows.append(
            {
                "shot": folder.name,
                "method": name,
                "warped": float(np.mean(changes)),
                "psnr": decibels(np.stack([*errors.values()])),
                "mirrors": decibels(mirrored),
            }
        )
    return rows


def over_time(frames: list[Frame]) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Pictures of a shot, `(H, W, 3)`: of ours frame by frame and with a history, and of OIDN."""
    for method in PICTURES:
        alone, history = (jflnr.Denoiser(method, backend="opencl") for _ in range(2))
        for name, call in (("", alone), (", history", history.next)):
            yield method + name, [np.asarray(call(frame))[..., :3] for frame in frames]
    yield "OIDN", [oidn.prefiltered(frame.beauty, **auxiliaries(frame)) for frame in frames]


def mirrors(frame: Frame) -> np.ndarray:
    """Where something else is seen than the surface itself, `(H, W)`."""
    apart = np.sum((np.asarray(frame.seen_normal) - np.asarray(frame.normal)) ** 2, axis=-1)
    return uniform_filter(apart, 5) > 0.3


def shown(scale: float, *images: Array) -> list[np.ndarray]:
    """Pictures as displayed."""
    return [display(np.asarray(image, np.float64), scale) for image in images]


def squares(image: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Squared error without the noise of the halves of a reference, `(H, W)`."""
    return np.mean((image - first) * (image - second), axis=-1)


def decibels(squares: np.ndarray) -> float:
    """PSNR."""
    return float(-10 * np.log10(np.mean(squares)))


def films_of(frame: Frame, folder: Path) -> dict[str, float]:
    """PSNR of alpha without the noise of the references': noisy, ours, and OIDN's second pass."""
    halves = references(folder / "reference.exr", "A")
    alpha = np.asarray(frame.alpha, np.float64)
    color, others = np.repeat(alpha, 3, axis=-1), auxiliaries(frame)
    films = {
        "noisy": alpha,
        "ours": jflnr.denoise(frame, "picture")[..., 3:],
        "raw": oidn.layers(color=color, **others)[..., :1],
        "clean": oidn.prefiltered(color, **others)[..., :1],
        "alone": oidn.layers(color=color)[..., :1],
    }
    return {name: decibels(squares(film, *halves)) for name, film in films.items()}


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
    ours, wanted, *halves = shown(scale, image, (first + second) / 2, first, second)
    return {
        "psnr": decibels(squares(ours, *halves)),
        "ssim": ssim(ours, wanted),
        "flip": flip(ours, wanted),
    }
