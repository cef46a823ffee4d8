"""The heat map of the atlas, and its counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch, Rectangle

from experiments import plots
from experiments.stability.cases import CASES
from experiments.stability.measures import ERROR_BAR, OVERSHOOT_BAR, passes
from experiments.stability.methods import METHODS, OURS

Row = dict[str, Any]
WORST = 1e4
BLACK, EMPTY = "#000000", "#dddddd"


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
                    if cell and cell.get("error") and (cell.get("overshoot") or 0) > OVERSHOOT_BAR:
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
    if cell["not_finite"] or cell.get("error") is None:
        return BLACK
    return colours(scale(np.clip(cell["error"], 1, WORST)))


def counts(cells: list[Row]) -> list[Row]:
    """How many cells clear the bar, methods down and precisions across."""
    precisions = list(dict.fromkeys(c["precision"] for c in cells))
    rows = []
    for method in dict.fromkeys(c["method"] for c in cells):
        row = {"method": method}
        for precision in precisions:
            some = [c for c in cells if (c["method"], c["precision"]) == (method, precision)]
            row[precision] = f"{sum(map(passes, some))} of {len(some)}" if some else "-"
        rows.append(row)
    return rows
