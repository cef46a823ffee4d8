"""The paper's Table 1 on our frames: every method, all metrics, time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments import data, plots, results, resume
from experiments.methods import basic, ours, peers
from experiments.pareto import MARKS, pareto_front, scatter
from experiments.timing import times
from jflnr.metrics import measure

NAME = "table1"
QUESTION = "How does every method do at one sample per pixel, in all metrics and in time?"
MINUTES = 3

METRICS = ("psnr", "ssim", "flip", "rmse", "smape", "mse", "mse_unbiased")
PICTURE = {
    "method": "method",
    "psnr": "PSNR, dB",
    "ssim": "SSIM",
    "flip": "FLIP",
    "rmse": "rMSE",
    "smape": "SMAPE",
}
COLUMNS = PICTURE | {
    "relative_mse_unbiased": "MSE less reference noise, / Figure 3's",
    "ms": "ms, 640 x 360",
    "per_flr": "time / FLR's",
}
# Of the paper's Table 1, on its frames and its GPU: methods that cannot be run here.
NOT_MEASURED = {
    "NBG": (33.458, 0.828, 0.074, 0.029),
    "MKPCN": (26.933, 0.603, 0.125, 0.057),
    "OptiX denoiser": (34.418, 0.813, 0.076, 0.026),
    "FLNR": (37.238, 0.904, 0.046, 0.018),
}


def run(quick: bool) -> dict[str, Any]:
    """Metrics of each method on each test frame, their means, and times."""
    methods = [*basic(), *peers(), *ours()]
    paths = [data.SHIPPED] if quick else data.frames("test")

    def on_frame(path: str) -> list[dict[str, Any]]:
        frame = data.read(Path(path))
        label = data.label(Path(path))
        return [{"method": m.name, "frame": label} | measure(frame, m(frame)) for m in methods]

    found = resume.rows(f"{NAME}{'-quick' * quick}", [str(path) for path in paths], on_frame)
    frames = [row for rows in found for row in rows]
    timed = [m for m in methods if m.family not in ("input", "Figure 3")]
    clock = times(timed, data.read(paths[0]), quick)
    means = [mean_of(frames, m.name) for m in methods]
    basis = next(row for row in means if row["method"] == "Figure 3")["mse_unbiased"]
    for row in means:
        row["relative_mse_unbiased"] = row["mse_unbiased"] / basis
        if row["method"] in clock:
            row["ms"] = clock[row["method"]]
            row["per_flr"] = row["ms"] / clock["flr"]
    return {"means": means, "frames": frames}


def mean_of(rows: list[dict[str, Any]], method: str) -> dict[str, Any]:
    """The mean of every metric over the frames."""
    mine = [row for row in rows if row["method"] == method]
    return {"method": method} | {
        key: float(np.mean([row[key] for row in mine]))
        for key in METRICS
        if all(row[key] is not None for row in mine)
    }


def draw(result: dict[str, Any], folder: Path) -> None:
    """table1.md: means with the paper's rows, then PSNR per frame; table1.png: PSNR and time."""
    rows = list(result["means"])
    for name, (psnr, ssim, flip, rmse) in NOT_MEASURED.items():
        figures = {"psnr": psnr, "ssim": ssim, "flip": flip, "rmse": rmse}
        rows.append({"method": f"{name} (not measured: the paper's, on its frames)"} | figures)
    text = results.table(rows, COLUMNS)
    plots.write_text(folder / f"{NAME}.md", text + "\n" + per_frame(result["frames"]))
    timed = [row | {"family": family(row["method"])} for row in result["means"] if "ms" in row]
    front = set(pareto_front([(row["ms"], row["psnr"]) for row in timed]))
    scatter(folder / f"{NAME}.png", [r | {"front": i in front} for i, r in enumerate(timed)])


def family(method: str) -> str:
    """A key of `pareto.MARKS`, from a method's name."""
    return next((f for f in MARKS if method.startswith(f)), "jflnr")


def per_frame(frames: list[dict[str, Any]]) -> str:
    """PSNR of every method on every frame."""
    labels = list(dict.fromkeys(row["frame"] for row in frames))
    rows: dict[str, dict[str, Any]] = {}
    for row in frames:
        rows.setdefault(row["method"], {"method": row["method"]})[row["frame"]] = row["psnr"]
    columns = {"method": "PSNR, dB"} | {label: label.removeprefix("test/") for label in labels}
    return results.table(list(rows.values()), columns)
