"""Every method on sequences: BMFR's Tables 2 and 3 on our frames, lag, and parts of the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments import resume, shots, temporal_metrics
from experiments.results import Parts, Row, pivoted
from jflnr.frame import Frame

NAME = "sequences"
QUESTION = "Who is stable over time and stays near the truth, whatever moves?"
MINUTES = 10

SETTLED = 8  # frames after which means over a sequence begin
REFERENCE = "reference"
QUICK = ("flr", "flr, temporal")
# What is shown of the rows, from frame `SETTLED` on but for the last five.
TABLES = {
    "psnr": "PSNR, dB",
    "psnr_unbiased": "PSNR less reference noise, dB",
    "warped": "warped error x 1000",
    "false": "false change x 1000",
    "ssim": "SSIM",
    "rmse": "RMSE",
    "temporal": "temporal error",
    "lag": "lag, frames",
}
MARGIN = {
    "flnr": "FLNR frame by frame",
    "BMFR": "BMFR",
    "BMFR without TAA": "BMFR without TAA",
    "SVGF": "SVGF",
    "SVGF, tuned": "SVGF, tuned",
    "OIDN of averages": "OIDN of averages",
}


def run(quick: bool) -> Parts:
    """Metrics of each method on each sequence."""
    names = ["made up"] if quick else shots.names()
    methods = {m.name: m for m in shots.methods() if not quick or m.name in QUICK}
    keys = [f"{name}|{method}" for name in names for method in (REFERENCE, *methods)]

    def row(key: str) -> dict[str, Any]:
        name, method = key.split("|")
        shot = shots.load(name)
        about = {"shot": shot.name, "motion": shot.motion, "split": shot.split, "method": method}
        if method == REFERENCE:
            lights = [np.asarray(frame.reference) for frame in shot.frames]
            return about | {"family": REFERENCE} | of_reference(shot.frames, lights)
        lights = methods[method].run(shot.frames)
        return about | {"family": methods[method].family} | measured(shot, lights)

    rows = resume.rows(f"{NAME}{'-quick' * quick}", keys, row)
    tables = {title: table(rows, key) for key, title in TABLES.items()}
    tables |= {
        "ours against others": margins(rows),
        "by part, PSNR less reference noise, dB": parts(rows),
    }
    return {title: found for title, found in tables.items() if found}


def of_reference(frames: tuple[Frame, ...], lights: list[np.ndarray]) -> dict[str, Any]:
    """The errors in time that the references have, by true change and by their own noise."""
    found = temporal_metrics.measure_sequence(frames, lights)[1:]
    return {key: float(np.mean([row[key] for row in found])) for key in ("temporal", "warped")}


def measured(shot: shots.Shot, lights: list[np.ndarray]) -> dict[str, Any]:
    """Means, and how a method follows the light and what comes up."""
    frames = temporal_metrics.measure_sequence(shot.frames, lights)
    settled = frames[SETTLED:]
    rmse = [10 ** (-frame["psnr"] / 20) for frame in frames]
    found: dict[str, Any] = {
        "psnr": average(settled, "psnr"),
        "psnr_unbiased": mean([frame["psnr_unbiased"] for frame in settled]),
        "warped": average(settled, "warped"),
        "false": root_mean([frame.get("false") for frame in settled]),
        "ssim": average(frames, "ssim"),
        "rmse": float(np.mean(rmse)),
        "temporal": average(frames[1:], "temporal"),
    }
    mask = stack([frame.mask for frame in shot.frames])
    images, truth = (mask * stack(some) for some in (lights, [f.reference for f in shot.frames]))
    if shot.motion == "light":
        found["lag"] = temporal_metrics.lag(images, truth)
    if shot.motion == "switch":
        response = temporal_metrics.response(images, truth[0], truth[-1])
        found["lag"] = float(np.sum(1 - response[len(truth) // 2 :]))
    if shot.motion in ("camera", "object"):
        still = shot.motion == "object"
        found["parts"] = temporal_metrics.by_region(shot.frames, lights, still)
    return found


def average(rows: Sequence[Row], key: str) -> float:
    """The mean over frames."""
    return float(np.mean([row[key] for row in rows]))


def stack(images: Sequence[Any]) -> np.ndarray:
    """Images of all frames, `(T, H, W, C)`."""
    return np.stack([np.asarray(image) for image in images])


def mean(values: list[float | None]) -> float | None:
    """The mean, or None if one of the values is missing."""
    found = [value for value in values if value is not None]
    return float(np.mean(found)) if len(found) == len(values) else None


def root_mean(squares: list[float | None]) -> float | None:
    """The root of the mean of squares, which less noise of the references may leave below 0."""
    found = mean(squares)
    return None if found is None else max(found, 0) ** 0.5


def margins(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How each of our methods with a history compares with others, sequence by sequence."""
    by = {(row["shot"], row["method"]): row for row in rows}
    found = []
    for row in rows:
        if row["family"] != "ours":
            continue
        line = {"sequence": row["shot"].replace("_", ", "), "method": row["method"]}
        for other, title in MARGIN.items():
            if (theirs := by.get((row["shot"], other))) is not None:
                ours, other_psnr = row["psnr_unbiased"], theirs["psnr_unbiased"]
                if ours is not None and other_psnr is not None:
                    line[f"PSNR above {title}"] = ours - other_psnr
                line[f"warped error below {title}, times"] = theirs["warped"] / row["warped"]
                if row.get("false") and theirs.get("false"):
                    line[f"false change below {title}, times"] = theirs["false"] / row["false"]
                if "lag" in row and other == "BMFR":
                    line["lag / BMFR's"] = row["lag"] / theirs["lag"]
        found.append(line)
    return found


def table(rows: list[Row], key: str) -> list[Row]:
    """One metric: methods down, sequences across."""
    times = 1000 if key in ("warped", "false") else 1
    named = [row | {"shot": row["shot"].replace("_", ", ")} for row in rows]
    scaled = [row | {key: times * row[key]} for row in named if row.get(key) is not None]
    return pivoted(scaled, "method", "shot", key)


def parts(rows: list[Row]) -> list[Row]:
    """PSNR by part of the picture, on the sequences where something comes into view."""
    return [
        {"sequence": row["shot"].replace("_", ", "), "method": row["method"]} | row["parts"]
        for row in rows
        if "parts" in row
    ]
