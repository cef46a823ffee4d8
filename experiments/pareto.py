"""Accuracy against time of every method and every setting: the paper's Figure 8."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import numpy as np

from experiments import data, plots, results, resume
from experiments.methods import Method, ours, peers
from experiments.settings import flr_settings, oidn_settings
from experiments.timing import times
from experiments.tune import quick_psnr

NAME = "pareto"
QUESTION = "Which method and setting is the most accurate in a given time?"
MINUTES = 4

MARKS = {
    "jflnr": ("o", 0),
    "OIDN": ("s", 1),
    "guided filter": ("^", 2),
    "BMFR, one frame": ("D", 3),
}
MARKS |= {"fast guided filter": ("v", 4), "SVGF, spatial": ("P", 5), "a-trous": ("X", 6)}


def run(quick: bool) -> dict[str, Any]:
    """Mean PSNR over the test frames, and milliseconds at 640 x 360."""
    methods = every_method()
    if quick:
        methods = [m for m in methods if m.family in ("jflnr", "fast guided filter")][:6]
    paths = [data.SHIPPED] if quick else data.frames("test")
    by_name = {m.name: m for m in methods}
    frames = [data.read(path) for path in paths]

    def accuracy(name: str) -> list[float]:
        return [quick_psnr(frame, by_name[name](frame)) for frame in frames]

    found = resume.rows(f"{NAME}{'-quick' * quick}", list(by_name), accuracy)
    clock = times(methods, frames[0], quick)
    rows: list[dict[str, Any]] = [
        {"method": m.name, "family": m.family, "psnr": float(np.mean(values))}
        | {"ms": clock[m.name]}
        for m, values in zip(methods, found, strict=True)
    ]
    front = set(pareto_front([(row["ms"], row["psnr"]) for row in rows]))
    for index, row in enumerate(rows):
        row["front"] = index in front
    return {"device": jax.default_backend(), "rows": rows}


def every_method() -> list[Method]:
    """All methods, without a setting twice."""
    general = [m for m in peers() if m.family != "OIDN"]
    return [*ours(), *flr_settings(), *general, *oidn_settings()]


def pareto_front(points: list[tuple[float, float]]) -> list[int]:
    """Numbers of the points (time, dB) that no other beats in both, fastest first.

    Less than 0.01 dB is no difference: backends round differently.
    """
    best, front = -np.inf, []
    for index in sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1])):
        if points[index][1] > best + 0.01:
            best = points[index][1]
            front.append(index)
    return front


def draw(result: dict[str, Any], folder: Path) -> None:
    """pareto.png (pareto-gpu.png where there was a GPU) and a table, fastest first."""
    stem = NAME if result["device"] == "cpu" else f"{NAME}-{result['device']}"
    rows = sorted(result["rows"], key=lambda row: row["ms"])
    shown = [row | {"front": "*" if row["front"] else ""} for row in rows]
    columns = {"method": "method", "psnr": "PSNR, dB", "ms": "ms, 640 x 360"}
    plots.write_text(folder / f"{stem}.md", results.table(shown, columns | {"front": "front"}))
    scatter(folder / f"{stem}.png", rows)


def scatter(path: Path, rows: list[dict[str, Any]]) -> None:
    """PSNR against time, the front drawn and named. rows: method, family, psnr, ms, front."""
    with plots.figure(path, size=(9.5, 6.2)) as axis:
        for family in dict.fromkeys(row["family"] for row in rows):
            mark, colour = MARKS[family]
            mine = [row for row in rows if row["family"] == family]
            x, y = [row["ms"] for row in mine], [row["psnr"] for row in mine]
            axis.plot(x, y, mark, color=plots.COLOURS[colour], label=family, alpha=0.8)
        front = sorted((row for row in rows if row["front"]), key=lambda row: row["ms"])
        axis.plot([r["ms"] for r in front], [r["psnr"] for r in front], "k-", lw=0.8, zorder=0)
        _name(axis, front)
        axis.set(xscale="log", xlabel="milliseconds at 640 x 360", ylabel="PSNR at 1 spp, dB")
        # The worst are in the table; they would flatten the rest.
        top = max(row["psnr"] for row in rows)
        axis.set_ylim(bottom=max(top - 9, min(row["psnr"] for row in rows) - 0.3), top=top + 0.8)
        axis.legend(loc="lower right", fontsize=8)


def _name(axis: Any, front: list[dict[str, Any]]) -> None:
    """Numbers on the points of the front, named in a box: labels would overlap."""
    for number, row in enumerate(front, 1):
        axis.annotate(
            str(number), (row["ms"], row["psnr"]), xytext=(-4, 5), textcoords="offset points"
        )
    text = "\n".join(f"{number}  {row['method']}" for number, row in enumerate(front, 1))
    place = {"transform": axis.transAxes, "va": "bottom", "fontsize": 8}
    axis.text(0.01, 0.02, "Pareto front\n" + text, **place, bbox={"fc": "white", "alpha": 0.8})
