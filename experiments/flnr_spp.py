"""FLNR against samples per pixel: from where on the network no longer helps."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, noise, plots, results, resume
from experiments.methods import oidn_peers
from experiments.spp import means
from jflnr import flnr
from jflnr.frame import Frame
from jflnr.metrics import measure

NAME = "flnr_spp"
QUESTION = "Up to how many samples per pixel is FLNR better than FLR, adaptive FLR and OIDN?"
MINUTES = 5

COUNTS = (1, 2, 4, 8, 16, 32, 64)
METHODS = ("flr", "flr-adaptive", *flnr.METHODS)
OIDN = "OIDN, tuned"
METRICS = {"psnr": "PSNR, dB", "ssim": "SSIM", "flip": "FLIP"}


def run(quick: bool) -> dict[str, Any]:
    """Mean metrics over a view of each test scene, for every number of samples."""
    paths = [data.SHIPPED] if quick else data.one_view_each("test")
    counts = COUNTS[:1] if quick else COUNTS

    def on_frame(path: str) -> list[dict[str, Any]]:
        frame, noisy = data.read(Path(path)), noise.layers(Path(path), counts)
        label = data.label(Path(path))
        return [
            {"frame": label, "spp": spp} | row
            for spp in counts
            for row in rows_of(
                without_lamps(dataclasses.replace(frame, indirect=noisy[f"indirect_{spp}"]))
            )
        ]

    found = resume.rows(f"{NAME}{'-quick' * quick}", [str(path) for path in paths], on_frame)
    frames = [row for rows in found for row in rows]
    return {"means": means(frames), "frames": frames}


def without_lamps(frame: Frame) -> Frame:
    """No light on lamps: the frames of the data folder store some there, our renderer none."""
    dark = ~np.any(np.asarray(frame.emission) > 0, axis=-1, keepdims=True)
    names = ("indirect", "reference", "reference_a")
    lights = {name: getattr(frame, name) for name in names}
    kept = {name: a * dark for name, a in lights.items() if a is not None}
    return dataclasses.replace(frame, **kept)


def rows_of(frame: Frame) -> list[dict[str, Any]]:
    """Metrics of every method on one frame."""
    images = {method: np.asarray(jflnr.denoise(frame, method)) for method in METHODS}
    images |= {peer.name: peer(frame) for peer in oidn_peers() if peer.name == OIDN}
    return [{"method": name} | measure(frame, image) for name, image in images.items()]


def draw(result: dict[str, Any], folder: Path) -> None:
    """flnr_spp.md: for every metric a table of methods by samples per pixel; and the chart."""
    rows = result["means"]
    counts = list(dict.fromkeys(row["spp"] for row in rows))
    columns = {"method": "samples per pixel"} | {str(spp): str(spp) for spp in counts}
    parts = []
    for metric, label in METRICS.items():
        by_method: dict[str, dict[str, Any]] = {}
        for row in rows:
            cells = by_method.setdefault(row["method"], {"method": row["method"]})
            cells[str(row["spp"])] = row[metric]
        parts.append(f"{label}\n\n{results.table(list(by_method.values()), columns)}")
    plots.write_text(folder / f"{NAME}.md", "\n".join(parts))
    with plots.figure(folder / f"{NAME}.png", columns=2) as axes:
        for axis, metric in zip(axes, ("psnr", "flip"), strict=True):
            for method in dict.fromkeys(row["method"] for row in rows):
                mine = [row for row in rows if row["method"] == method]
                axis.plot(
                    [row["spp"] for row in mine], [row[metric] for row in mine], "o-", label=method
                )
            axis.set(xscale="log", xlabel="samples per pixel", ylabel=METRICS[metric])
            axis.set_xticks(counts, map(str, counts))
            axis.minorticks_off()
        axes[0].legend(fontsize=8)
