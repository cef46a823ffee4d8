"""Every method on sequences: BMFR's Tables 2 and 3 on our frames, lag and recovery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator, NullFormatter

from experiments import plots, results, resume, shots
from jflnr import temporal_metrics
from jflnr.frame import Frame

NAME = "sequences"
QUESTION = "Who is stable over time and stays near the truth, whatever moves?"
MINUTES = 10

SETTLED = 8  # frames after which means over a sequence begin
REFERENCE = "reference"
QUICK = ("flr", "flr, temporal")
TABLES = {
    "psnr": "PSNR in dB, mean from frame 8 on",
    "psnr_unbiased": "The same without the noise of the references",
    "warped": "Warped temporal error x 1000, mean from frame 8 on",
    "false": "False change x 1000: RMS of what of it is not the references', from frame 8 on",
    "ssim": "SSIM, mean of all frames (BMFR, Table 2)",
    "rmse": "RMSE of the displayed picture, mean of all frames (BMFR, Table 2)",
    "temporal": "Temporal error, mean of all frames (BMFR, Table 3)",
    "lag": "Lag in frames, under a moving and after a switched light",
}
PER_FRAME = ("psnr", "ssim", "temporal", "warped")
# What charts show, and how: a pattern and a colour.
CHARTED = {
    "flnr": (":", plots.COLOURS[6]),
    "flr, temporal": ("-", plots.COLOURS[4]),
    "flr-adaptive, temporal": ("-", plots.COLOURS[0]),
    "flnr, temporal": ("-", plots.COLOURS[2]),
    "BMFR": ("--", plots.COLOURS[1]),
    "BMFR without TAA": ("-.", plots.COLOURS[1]),
    "SVGF": ("--", plots.COLOURS[3]),
    "SVGF, tuned": ("-.", plots.COLOURS[3]),
    "OIDN": (":", plots.COLOURS[5]),
}
MARGIN = {
    "flnr": "FLNR frame by frame",
    "BMFR": "BMFR",
    "BMFR without TAA": "BMFR without TAA",
    "SVGF": "SVGF",
    "SVGF, tuned": "SVGF, tuned",
}


def run(quick: bool) -> dict[str, Any]:
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
    return {"rows": rows, "margins": margins(rows)}


def of_reference(frames: tuple[Frame, ...], lights: list[np.ndarray]) -> dict[str, Any]:
    """The errors in time that the references have, by true change and by their own noise."""
    found = temporal_metrics.measure_sequence(frames, lights)[1:]
    return {key: float(np.mean([row[key] for row in found])) for key in ("temporal", "warped")}


def measured(shot: shots.Shot, lights: list[np.ndarray]) -> dict[str, Any]:
    """Means, the course of each metric, and how a method follows the light and what comes up."""
    frames = temporal_metrics.measure_sequence(shot.frames, lights)
    course: dict[str, Any] = {key: [frame.get(key) for frame in frames] for key in PER_FRAME}
    rmse = [10 ** (-frame["psnr"] / 20) for frame in frames]
    found: dict[str, Any] = {
        "psnr": float(np.mean(course["psnr"][SETTLED:])),
        "psnr_unbiased": mean([frame["psnr_unbiased"] for frame in frames[SETTLED:]]),
        "warped": float(np.mean(course["warped"][SETTLED:])),
        "false": root_mean([frame.get("false") for frame in frames[SETTLED:]]),
        "ssim": float(np.mean(course["ssim"])),
        "rmse": float(np.mean(rmse)),
        "temporal": float(np.mean(course["temporal"][1:])),
        "course": course,
    }
    mask = stack([frame.mask for frame in shot.frames])
    images, truth = (mask * stack(some) for some in (lights, [f.reference for f in shot.frames]))
    if shot.motion == "light":
        found["lag"] = temporal_metrics.lag(images, truth)
    if shot.motion == "switch":
        found["response"] = temporal_metrics.response(images, truth[0], truth[-1]).tolist()
        found["lag"] = float(np.sum(1 - np.array(found["response"][len(truth) // 2 :])))
    if shot.motion in ("camera", "object"):
        found["recovery"] = temporal_metrics.recovery(shot.frames, lights)
    return found


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
        line = {"shot": row["shot"], "method": row["method"]}
        for other, title in MARGIN.items():
            if (theirs := by.get((row["shot"], other))) is not None:
                line[f"PSNR above {title}"] = row["psnr"] - theirs["psnr"]
                line[f"warped error below {title}, times"] = theirs["warped"] / row["warped"]
                if row.get("false") and theirs.get("false"):
                    line[f"false change below {title}, times"] = theirs["false"] / row["false"]
                if "lag" in row and other == "BMFR":
                    line["lag / BMFR's"] = row["lag"] / theirs["lag"]
        found.append(line)
    return found


def draw(result: dict[str, Any], folder: Path) -> None:
    """sequences_figures.md, and charts over frames: sequences.png (PSNR), _flicker and _lag."""
    rows = result["rows"]
    parts = [
        f"## {title}\n\n{table(rows, key)}"
        for key, title in TABLES.items()
        if any(key in row for row in rows)
    ]
    parts.append(f"## Ours with a history against others\n\n{compared(result['margins'])}")
    parts.append(f"## PSNR in dB of places by frames since they came up\n\n{recoveries(rows)}")
    title = "# Sequences: figures\n\n`python -m experiments run sequences --docs docs`\n\n"
    plots.write_text(folder / f"{NAME}_figures.md", title + "\n".join(parts))
    chart(rows, lambda row: row["course"]["psnr"], "PSNR, dB", folder / f"{NAME}.png")
    flicker = lambda row: [None if v is None else 1000 * v for v in row["course"]["warped"]]
    path = folder / f"{NAME}_flicker.png"
    chart(rows, flicker, "warped temporal error x 1000", path, "log")
    switched = [row for row in rows if "response" in row]
    if switched:
        path = folder / f"{NAME}_lag.png"
        chart(switched, lambda row: row["response"], "share of the change of light", path)


def table(rows: list[dict[str, Any]], key: str) -> str:
    """One metric: methods down, sequences across."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        if row.get(key) is not None:
            value = row[key] * (1000 if key in ("warped", "false") else 1)
            lines.setdefault(row["method"], {"method": row["method"]})[row["shot"]] = value
    names = list(dict.fromkeys(row["shot"] for row in rows if row.get(key) is not None))
    columns = {"method": "method"} | {name: name.replace("_", ", ") for name in names}
    return results.table(list(lines.values()), columns)


def recoveries(rows: list[dict[str, Any]]) -> str:
    """PSNR by age, on the sequences where something comes into view."""
    ages = list(temporal_metrics.AGES)
    lines = [
        {"shot": row["shot"].replace("_", ", "), "method": row["method"]} | row["recovery"]
        for row in rows
        if "recovery" in row
    ]
    return results.table(
        lines, {"shot": "sequence", "method": "method"} | {age: age for age in ages}
    )


def compared(margins: list[dict[str, Any]]) -> str:
    """Gains in PSNR, quotients of flicker and of lag."""
    columns = {key: key for row in margins for key in row} | {"shot": "sequence"}
    return results.table(margins, columns)


def chart(
    rows: list[dict[str, Any]],
    values: Callable[[dict[str, Any]], list[float | None]],
    label: str,
    path: Path,
    scale: str = "linear",
) -> None:
    """What `values` finds in a row, over frames; a panel for each sequence."""
    names = list(dict.fromkeys(row["shot"] for row in rows))
    columns = min(len(names), 3)
    with plots.figure(path, columns, (4, 2.8), -(-len(names) // columns)) as axes:
        panels = np.atleast_1d(axes)
        for axis, name in zip(panels, names, strict=False):
            for row in rows:
                if row["shot"] == name and (style := CHARTED.get(row["method"])):
                    found = np.array(values(row), float)
                    axis.plot(found, style[0], color=style[1], label=row["method"])
            axis.set(title=name.replace("_", ", "), xlabel="frame", yscale=scale)
            axis.xaxis.set_major_locator(MaxNLocator(integer=True))
            # Those between powers of ten would overlap.
            axis.yaxis.set_minor_formatter(NullFormatter())
        for axis in panels[len(names) :]:
            axis.remove()
        panels[0].set_ylabel(label)
        # Below the panels, where it covers no curve.
        handles, labels = panels[0].get_legend_handles_labels()
        legend = {"loc": "outside lower center", "ncols": min(len(labels), 5), "fontsize": 8}
        panels[0].figure.legend(handles, labels, **legend)
