"""The heat map of the atlas, the pictures of its failures, its tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch, Rectangle

from experiments import plots, results
from experiments.stability.cases import CASES, Case
from experiments.stability.measures import ERROR_BAR, OVERSHOOT_BAR, passes
from experiments.stability.methods import METHODS, OURS

Row = dict[str, Any]
WORST = 1e4
BLACK, EMPTY = "#000000", "#dddddd"
COLUMNS = {
    "case": "case",
    "precision": "precision",
    "method": "method",
    "not_finite": "NaN or Inf, pixels",
    "error": "error, times the exact",
    "rounding": "off its own truth",
    "overshoot": "overshoot",
    "bias": "bias",
    "bleeding": "bleeding",
}


def heat_map(cells: list[Row], path: Path) -> None:
    """Methods down, cases across; in each square one stripe per precision."""
    methods = [m for m in METHODS if any(c["method"] == m for c in cells)]
    precisions = list(dict.fromkeys(c["precision"] for c in cells))
    found = {(c["method"], c["case"], c["precision"]): c for c in cells}
    colours, scale = matplotlib.colormaps["YlOrRd"], LogNorm(1, WORST)
    height = 1 / len(precisions)
    size = 2.6 + 0.62 * len(CASES), 2.6 + 0.62 * len(methods)
    with plots.figure(path, size=size) as axis:
        axis.grid(False)
        for y, method in enumerate(methods):
            for x, case in enumerate(CASES):
                for k, precision in enumerate(precisions):
                    cell = found.get((method, case, precision))
                    corner = x, y + k * height
                    axis.add_patch(
                        Rectangle(corner, 1, height, color=_colour(cell, scale, colours))
                    )
                    if cell and cell["error"] and (cell["overshoot"] or 0) > OVERSHOOT_BAR:
                        axis.plot(x + 0.5, y + (k + 0.5) * height, "k.", markersize=4)
        for x in range(len(CASES) + 1):
            axis.axvline(x, color="white", linewidth=2.5)
        for y, method in enumerate([*methods, ""]):
            first = y < len(methods) and method in OURS and methods[y - 1] not in OURS
            axis.axhline(y, color="black" if first else "white", linewidth=2.5)
        axis.set(xlim=(0, len(CASES)), ylim=(len(methods), 0))
        axis.set_xticks(np.arange(len(CASES)) + 0.5, CASES, rotation=40, ha="left")
        axis.set_yticks(np.arange(len(methods)) + 0.5, methods)
        axis.tick_params(length=0, labeltop=True, labelbottom=False)
        mappable = matplotlib.cm.ScalarMappable(scale, colours)
        bar = axis.figure.colorbar(mappable, ax=axis, shrink=0.6, extend="max", pad=0.01)
        bar.set_label("error, as a multiple of the exact solution's")
        bar.ax.axhline(ERROR_BAR, color="black")
        stripes = ", ".join(precisions)
        dots = f"overshoot above {OVERSHOOT_BAR} times the input's range"
        marks = [
            Patch(color=BLACK, label="NaN or infinity"),
            Patch(color=EMPTY, label="does not exist"),
        ]
        axis.legend(
            handles=marks,
            title=f"stripes from the top: {stripes};   dot: {dots}",
            loc="upper center",
            bbox_to_anchor=(0.5, -0.01),
            ncols=2,
            frameon=False,
        )


def _colour(cell: Row | None, scale: Any, colours: Any) -> Any:
    if cell is None:
        return EMPTY
    if cell["not_finite"] or cell["error"] is None:
        return BLACK
    return colours(scale(np.clip(cell["error"], 1, WORST)))


def failures(
    cells: list[Row], picture: Callable[[str, str], tuple[Case, np.ndarray]], path: Path
) -> None:
    """For every method that fails in float32, its results on up to four such cases, and ours."""
    bad: dict[str, list[str]] = {}
    for cell in cells:
        if cell["precision"] == "float32" and not passes(cell) and cell["method"] not in OURS:
            bad.setdefault(cell["method"], []).append(cell["case"])
    shown = _most_telling(bad)
    methods = [*(m for m in METHODS if m in bad), "ours, Cholesky"]
    with plots.figure(path, columns=len(shown), size=(1.9, 1.75 * (len(methods) + 1))) as axes:
        for axis, case in zip(axes, shown, strict=True):
            axis.set_axis_off()
            axis.set_title(case, fontsize=10)
            made, _ = picture("ours, Cholesky", case)
            light = made.target[..., 1].astype(np.float64)
            low, high = float(light.min()), float(max(light.max(), light.min() + 1e-30))
            images = [made.target[..., 0].astype(np.float64)]
            images += [picture(method, case)[1].astype(np.float64) for method in methods]
            for i, (name, image) in enumerate(zip(["input", *methods], images, strict=True)):
                inset = axis.inset_axes((0.02, 1 - (i + 1) / len(images), 0.96, 0.86 / len(images)))
                inset.imshow(_painted(image, low, high))
                inset.set(xticks=[], yticks=[])
                inset.grid(False)
                inset.set_title(name, fontsize=8, pad=2)


def _most_telling(bad: dict[str, list[str]], most: int = 6) -> list[str]:
    """The cases that fail most methods, in the order of the atlas."""
    count = {case: sum(case in cases for cases in bad.values()) for case in CASES}
    chosen = sorted(count, key=lambda case: -count[case])[:most]
    return [case for case in CASES if case in chosen]


def _painted(image: np.ndarray, low: float, high: float) -> np.ndarray:
    """Grey from `low` to `high` of the true light; magenta NaN or Inf, blue below, red above."""
    with np.errstate(all="ignore"):
        grey = 0.15 + 0.7 * np.clip((image - low) / (high - low), 0, 1)
    rgb = np.repeat(np.nan_to_num(grey)[..., None], 3, -1)
    far = 2 * (high - low)
    rgb[image > high + far] = (0.84, 0.1, 0.1)
    rgb[image < low - far] = (0.1, 0.3, 0.85)
    rgb[~np.isfinite(image)] = (0.9, 0.2, 0.9)
    return rgb


def tables(result: dict[str, Any], path: Path) -> None:
    """A count per method, the robust fits, and the figures of float32 and float16."""
    cells = result["cells"]
    text = "Cells that clear the bar, of all cases:\n\n" + results.table(*_counts(cells))
    columns = {"spp": "spp", "fit": "fit", "typical": "median error", "error": "error"}
    text += "\nRobust fits under heavy-tailed noise, relative to the mean light:\n\n"
    text += results.table(result["fireflies"], columns | {"bias": "bias"})
    text += "\nThe same on real frames, of the brightness:\n\n"
    real = result["real fireflies"]
    text += results.table(real, {"frame": "frame"} | columns | {"bias": "bias"})
    text += "\nEvery cell of float32 and float16 (the others are in stability.json):\n\n"
    some = [c for c in cells if c["precision"] in ("float32", "float16")]
    shown = [{k: "NaN" if v is None and k in _LOST else v for k, v in c.items()} for c in some]
    text += results.table([{k: v for k, v in c.items() if v is not None} for c in shown], COLUMNS)
    plots.write_text(path, text)


_LOST = ("error", "rounding", "overshoot", "bias")


def _counts(cells: list[Row]) -> tuple[list[Row], dict[str, str]]:
    precisions = list(dict.fromkeys(c["precision"] for c in cells))
    rows = []
    for method in dict.fromkeys(c["method"] for c in cells):
        row = {"method": method}
        for precision in precisions:
            some = [c for c in cells if (c["method"], c["precision"]) == (method, precision)]
            row[precision] = f"{sum(map(passes, some))} of {len(some)}" if some else "-"
        rows.append(row)
    return rows, {name: name for name in ("method", *precisions)}
