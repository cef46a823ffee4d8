"""Method auto: what it costs and keeps of flr-adaptive, and how well it chooses what to refine."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, plots, resume
from experiments.results import Parts, Row
from experiments.timing import interleaved
from jflnr.frame import Array, Frame
from jflnr.metrics import display, exposure
from jflnr.regression.auto import Auto, signal_in_tiles

NAME = "auto"
QUESTION = "Does method auto refine where it pays, and what is that worth?"
MINUTES = 6

# Of the times of all cores together, whose best counts.
REPEATS = 7
# Samples per pixel at which frames are timed.
TIMED = (1, 4)
SHARES = (0.1, 0.25, 0.5, 0.75)
METHODS = "flr", "flr-adaptive", "auto"
BY = "gain kept, dB"


def run(quick: bool) -> Parts:
    """PSNR and processor time of every frame, and the gain kept by the share of tiles refined."""
    paths = [data.SHIPPED] if quick else data.frames("train", "val", "test")
    keys = [f"{path}:{spp}" for path in paths for spp in (1, 4, 16) if data.has(path, spp)]
    rows = resume.rows(f"{NAME}{'-quick' * quick}", keys, lambda key: one(key, quick))
    return {"means": means(rows), BY: curves(rows), "by frame": [row["psnr"] for row in rows]}


def one(key: str, quick: bool) -> dict[str, Any]:
    """One frame at one sample count. quick: without times."""
    path, spp = key.rsplit(":", 1)
    frame = jflnr.read_frame(Path(path), spp=int(spp))
    calls = denoisers()
    error = {name: squared_error(frame, denoise(frame)) for name, denoise in calls.items()}
    signal, side = signal_in_tiles(frame)
    row: Row = {"frame": data.label(Path(path)), "spp": int(spp)}
    row |= {f"{name}, dB": float(-10 * np.log10(error[name].mean())) for name in METHODS}
    row["refined"] = float(np.mean(signal > Auto().worth))
    if not quick and int(spp) in TIMED:
        large = tiled(frame)
        timed: dict[str, Callable[[], Any]]
        timed = {name: functools.partial(calls[name], large) for name in METHODS}
        times = interleaved(timed, REPEATS, time.process_time)
        row |= {f"{name}, processor ms": 1e3 * t for name, t in times.items()}
    coarse, whole = (in_tiles(error[name], side) for name in ("nowhere", "everywhere"))
    return {"psnr": row} | {"curve": kept(coarse, whole, signal)}


def denoisers() -> dict[str, Callable[[Frame], Array]]:
    """The methods, and auto with nothing and with everything refined; in OpenCL if it is there."""
    methods: dict[str, Any] = {name: name for name in METHODS}
    methods |= {"nowhere": Auto(worth=1.0), "everywhere": Auto(worth=None)}
    return {name: jflnr.Denoiser(method, backend="auto") for name, method in methods.items()}


def squared_error(frame: Frame, light: Array) -> np.ndarray:
    """Of every pixel as it is displayed, `(H, W)`: what PSNR is the mean of."""
    albedo = np.asarray(frame.albedo, np.float64)
    found, wanted = (albedo * np.asarray(image, np.float64) for image in (light, frame.reference))
    scale = exposure(wanted)
    return np.mean((display(found, scale) - display(wanted, scale)) ** 2, axis=-1)


def in_tiles(plane: np.ndarray, side: int) -> np.ndarray:
    """Sums over tiles."""
    height, width = plane.shape
    plane = np.pad(plane, ((0, -height % side), (0, -width % side)))
    h, w = (size // side for size in plane.shape)
    return plane.reshape(h, side, w, side).sum(axis=(1, 3))


def kept(coarse: np.ndarray, whole: np.ndarray, signal: np.ndarray) -> dict[str, list[float]]:
    """Decibels above the coarse result with SHARES of the tiles refined: by what auto judges by, by
    an oracle and by chance; and with all of them."""
    gain, total = (coarse - whole).ravel(), coarse.sum()
    chance = np.random.default_rng(0).random(gain.size)
    found = {}
    for name, score in (("auto", signal.ravel()), ("oracle", gain), ("chance", chance)):
        sums = np.cumsum(gain[np.argsort(-score)])
        ends = [round(share * gain.size) - 1 for share in SHARES] + [gain.size - 1]
        found[name] = [float(-10 * np.log10(1 - sums[max(end, 0)] / total)) for end in ends]
    return found


def tiled(frame: Frame, height: int = 1080, width: int = 1920) -> Frame:
    """The frame beside and below itself, up to the size of a screen: for times only."""

    def tile(layer: Array) -> np.ndarray:
        h, w = layer.shape[:2]
        return np.tile(layer, (-(-height // h), -(-width // w), 1))[:height, :width]

    layers = {name: tile(layer) for name, layer in frame.layers().items()}
    return dataclasses.replace(frame, **layers)


def groups(rows: list[dict[str, Any]]) -> dict[tuple[str, int], list[dict[str, Any]]]:
    """The rows by split and samples."""
    found: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for row in rows:
        split = row["psnr"]["frame"].split("/")[0]
        found.setdefault((split, row["psnr"]["spp"]), []).append(row)
    return found


def means(rows: list[dict[str, Any]]) -> list[Row]:
    """Of the frames of a split."""
    found: list[Row] = []
    for (split, spp), some in groups(rows).items():
        psnr = [row["psnr"] for row in some]
        names = [name for name in psnr[0] if name not in ("frame", "spp")]
        row: Row = {"split": split, "spp": spp, "frames": len(some)}
        row |= {name: float(np.mean([one[name] for one in psnr])) for name in names}
        lost = [one["auto, dB"] - one["flr-adaptive, dB"] for one in psnr]
        row |= {"against flr-adaptive, dB": float(np.mean(lost)), "worst frame, dB": min(lost)}
        if "auto, processor ms" in row:
            ratio = row["auto, processor ms"] / row["flr-adaptive, processor ms"]
            row["time / flr-adaptive"] = float(ratio)
        found.append(row)
    return found


def curves(rows: list[dict[str, Any]]) -> list[Row]:
    """Means of the frames of a split of what is kept."""
    found: list[Row] = []
    for (split, spp), some in groups(rows).items():
        for name in some[0]["curve"]:
            decibels = np.mean([row["curve"][name] for row in some], axis=0)
            row: Row = {"split": split, "spp": spp, "chosen by": name}
            ends = [f"{share:.0%}" for share in SHARES] + ["all"]
            found.append(row | dict(zip(ends, map(float, decibels), strict=True)))
    return found


def charts(parts: Parts, folder: Path) -> None:
    """auto.png: decibels kept against the share of tiles refined, on the test frames."""
    test = [row for row in parts[BY] if row["split"] == "test"]
    with plots.figure(folder / f"{NAME}.png", columns=3) as axes:
        for axis, spp in zip(axes, (1, 4, 16), strict=True):
            for row, style in zip([r for r in test if r["spp"] == spp], plots.MARKS, strict=False):
                x = [0, *SHARES, 1]
                y = [0, *(row[f"{share:.0%}"] for share in SHARES), row["all"]]
                axis.plot(x, y, style + "-", label=row["chosen by"])
            axis.set(xlabel="share of tiles refined", title=f"{spp} samples", ylim=(0, None))
        axes[0].set(ylabel="dB above nothing refined")
        axes[0].legend(fontsize=8)
