"""Accuracy against samples per pixel: the paper's Figure 7."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, plots, results, resume
from experiments.methods import basic, peers
from experiments.peers import nfor
from experiments.tune import mean_psnr
from jflnr.regression.parameters import DEFAULT, Parameters
from jflnr.frame import Array, Frame
from jflnr.metrics import measure

NAME = "spp"
QUESTION = "How does each method gain from more samples per pixel?"
MINUTES = 13

# Independent streams of the files that together make so many samples per pixel.
STREAMS = {"1": (1,), "4": (4,), "5": (1, 4), "16": (16,), "20": (4, 16)}
PEERS = ("guided filter, tuned", "SVGF, spatial, tuned", "BMFR, one frame, tuned", "OIDN, tuned")
SIGMAS = (4.0, 6.0, 8.0, 11.0, 15.0, 20.0)
METRICS = ("psnr", "ssim", "flip", "rmse")
# Of the table, not in the chart: far below it, or on top of another line.
LEFT_OUT = ("noisy", "bmfr", "flnr-tiny", "flnr-small")


def run(quick: bool) -> dict[str, Any]:
    """Mean metrics over a view of each test scene; NFOR where there are two halves."""
    tag = "-quick" * quick
    budgets = ["1"] if quick else list(STREAMS)
    shipped = [data.SHIPPED]
    # One view of each scene: NFOR takes its minutes.
    paths = [str(path) for path in (shipped if quick else data.one_view_each("test"))]
    tuning = shipped if quick else data.one_view_each("val")

    def best_sigma(spp: str) -> float:
        frames = [data.read(path, *STREAMS[spp]) for path in tuning]
        return max(SIGMAS, key=lambda sigma: mean_psnr(frames, flr_of_sigma, {"sigma": sigma}))

    sigma = dict(zip(budgets, resume.rows(f"{NAME}-sigma{tag}", budgets, best_sigma), strict=True))

    def on_frame(path: str) -> list[dict[str, Any]]:
        return [row for spp in budgets for row in rows_of(Path(path), spp, sigma[spp])]

    frames = [row for rows in resume.rows(f"{NAME}{tag}", paths, on_frame) for row in rows]
    return {"sigma": sigma, "means": means(frames), "frames": frames}


def flr_of_sigma(frame: Frame, *, sigma: float) -> Array:
    """FLR with another window."""
    parameters = Parameters.of(sigma, float(DEFAULT.eps), float(DEFAULT.eps_prime))
    return jflnr.denoise(frame, parameters=parameters)


def rows_of(path: Path, spp: str, sigma: float) -> list[dict[str, Any]]:
    """Metrics of every method on one frame at one number of samples."""
    streams = STREAMS[spp]
    frame = data.read(path, *streams)
    images = {m.name: m(frame) for m in [*basic()[:1], *peers()] if m.name in ("noisy", *PEERS)}
    images |= {method: np.asarray(jflnr.denoise(frame, method)) for method in jflnr.METHODS}
    images["flr, sigma for this spp"] = np.asarray(flr_of_sigma(frame, sigma=sigma))
    if len(streams) == 2:
        a, b = ((data.read(path, n).indirect, n) for n in streams)
        images["NFOR"] = np.asarray(nfor.denoise(frame, halves=(a, b), **nfor.PAPER))
    return [
        {"method": name, "spp": int(spp), "frame": data.label(path)} | measure(frame, image)
        for name, image in images.items()
    ]


def means(frames: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The mean over frames for each method and number of samples."""
    keys = dict.fromkeys((row["method"], row["spp"]) for row in frames)
    found = []
    for method, spp in keys:
        mine = [row for row in frames if (row["method"], row["spp"]) == (method, spp)]
        values = {k: float(np.mean([row[k] for row in mine])) for k in METRICS}
        found.append({"method": method, "spp": spp} | values)
    return found


def draw(result: dict[str, Any], folder: Path) -> None:
    """spp.png: PSNR and FLIP; spp.md: the means."""
    columns = {"method": "method", "spp": "spp", "psnr": "PSNR, dB", "ssim": "SSIM"}
    columns |= {"flip": "FLIP", "rmse": "rMSE"}
    plots.write_text(folder / f"{NAME}.md", results.table(result["means"], columns))
    methods = list(dict.fromkeys(row["method"] for row in result["means"]))
    marks = "osD^vPX*<>"
    with plots.figure(folder / f"{NAME}.png", columns=2, size=(5.5, 5)) as axes:
        for axis, metric, label in zip(
            axes, ("psnr", "flip"), ("PSNR, dB", "FLIP (less is better)"), strict=True
        ):
            for number, method in enumerate(m for m in methods if m not in LEFT_OUT):
                mine = sorted(
                    (row for row in result["means"] if row["method"] == method),
                    key=lambda row: row["spp"],
                )
                x, y = [row["spp"] for row in mine], [row[metric] for row in mine]
                style = "-" if number < 7 else "--"
                axis.plot(x, y, marks[number] + style, label=method)
            ticks = sorted({row["spp"] for row in result["means"]})
            axis.set(xscale="log", xlabel="samples per pixel", ylabel=label)
            axis.set_xticks([t for t in ticks if t not in (5, 20)] or ticks)
            axis.set_xticklabels([str(t) for t in ticks if t not in (5, 20)] or map(str, ticks))
            axis.minorticks_off()
        axes[0].legend(fontsize=8)
