"""Charts that survive printing and colour blindness."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from jflnr.files import replacing, write_atomically

# Okabe and Ito's colours, told apart also by those who do not see red or green.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")


@contextmanager
def figure(
    path: Path, columns: int = 1, size: tuple[float, float] = (5.5, 4), rows: int = 1
) -> Iterator[Any]:
    """Axes side by side, row after row, written to `path` when the block ends."""
    shape = (size[0] * columns, size[1] * rows)
    drawing, grid = plt.subplots(rows, columns, figsize=shape, layout="constrained", squeeze=False)
    axes = grid.ravel() if grid.size > 1 else grid[0, 0]
    for axis in grid.flat:
        axis.set_prop_cycle(color=COLOURS)
        axis.grid(True, which="major", alpha=0.3)
    yield axes
    with replacing(path) as beside:
        drawing.savefig(beside, dpi=130, format=path.suffix[1:])
    plt.close(drawing)


MARKS = "osD^vPX*<>"
LABELS = {
    "psnr": "PSNR, dB",
    "ssim": "SSIM",
    "flip": "FLIP (less is better)",
    "rmse": "rMSE",
    "smape": "SMAPE",
    "ms": "milliseconds",
    "spp": "samples per pixel",
    "block": "block, pixels on a side",
}


def lines(
    path: Path, rows: list[dict[str, Any]], x: str, y: tuple[str, ...], by: str, most: int = 10
) -> None:
    """A panel for each of `y` over `x`, a line for each value of `by`."""
    with figure(path, columns=len(y), size=(5.5, 4.6)) as found:
        axes = np.atleast_1d(found)
        for axis, key in zip(axes, y, strict=True):
            for number, name in enumerate(list(dict.fromkeys(row[by] for row in rows))[:most]):
                mine = [row for row in rows if row[by] == name and key in row]
                mine.sort(key=lambda row: row[x])
                style = MARKS[number] + ("-" if number < len(COLOURS) else "--")
                axis.plot([row[x] for row in mine], [row[key] for row in mine], style, label=name)
            ticks = sorted({row[x] for row in rows})
            axis.set(xscale="log", xlabel=LABELS.get(x, x), ylabel=LABELS.get(key, key))
            axis.set_xticks(ticks, map(str, ticks))
            axis.minorticks_off()
        axes[0].legend(fontsize=8)


def scatter(path: Path, rows: list[dict[str, Any]]) -> None:
    """PSNR against time, the front drawn and named. rows: method, family, psnr, ms."""
    rows = sorted(rows, key=lambda row: row["ms"])
    best = front([(row["ms"], row["psnr"]) for row in rows])
    with figure(path, size=(9.5, 6.2)) as axis:
        for number, family in enumerate(dict.fromkeys(row["family"] for row in rows)):
            mine = [row for row in rows if row["family"] == family]
            x, y = [row["ms"] for row in mine], [row["psnr"] for row in mine]
            axis.plot(x, y, MARKS[number], label=family, alpha=0.8)
        points = [(rows[index]["ms"], rows[index]["psnr"]) for index in best]
        axis.plot(*np.transpose(points), "k-", lw=0.8, zorder=0)
        for number, point in enumerate(points, 1):
            axis.annotate(str(number), point, xytext=(-4, 5), textcoords="offset points")
        # Numbers, named in a box: labels would overlap.
        names = [f"{number}  {rows[index]['method']}" for number, index in enumerate(best, 1)]
        place = {"transform": axis.transAxes, "va": "bottom", "fontsize": 8}
        box = {"fc": "white", "alpha": 0.8}
        axis.text(0.01, 0.02, "\n".join(["Pareto front", *names]), **place, bbox=box)
        axis.set(xscale="log", xlabel="milliseconds at 640 x 360", ylabel="PSNR at 1 spp, dB")
        # The worst are in the table; they would flatten the rest.
        top = max(row["psnr"] for row in rows)
        axis.set_ylim(bottom=max(top - 9, min(row["psnr"] for row in rows) - 0.3), top=top + 0.8)
        axis.legend(loc="lower right", fontsize=8)


def front(points: list[tuple[float, float]]) -> list[int]:
    """Numbers of the points (time, dB) that no other beats in both, fastest first.

    Less than 0.01 dB is no difference: backends round differently.
    """
    best, found = -np.inf, []
    for index in sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1])):
        if points[index][1] > best + 0.01:
            best = points[index][1]
            found.append(index)
    return found


def write_text(path: Path, text: str) -> None:
    """Text, written whole or not at all."""
    write_atomically(path, text.encode())


def contact_sheet(path: Path, rows: list[tuple[dict[str, Any], dict[str, Any]]]) -> None:
    """Crops side by side, one row each: (`frame`, `corner` and `metrics`, name to picture)."""
    names = list(rows[0][1])
    shape = (1.75 * len(names), 2.15 * len(rows))
    drawing, axes = plt.subplots(
        len(rows), len(names), figsize=shape, layout="constrained", squeeze=False
    )
    for line, (crop, pictures) in zip(axes, rows, strict=True):
        for axis, (name, picture) in zip(line, pictures.items(), strict=True):
            axis.imshow(picture, interpolation="nearest")
            axis.set(xticks=[], yticks=[])
            found = crop["metrics"].get(name)
            text = "PSNR / FLIP" if found is None else f"{found['psnr']:.2f} / {found['flip']:.3f}"
            axis.set_xlabel(text, fontsize=8)
            axis.set_title(name.replace(", tuned", ""), fontsize=8)
        line[0].set_ylabel("{frame} {corner}".format(**crop), fontsize=7)
    with replacing(path) as beside:
        drawing.savefig(beside, dpi=130, format=path.suffix[1:])
    plt.close(drawing)
