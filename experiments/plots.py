"""Charts that survive printing and colour blindness."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

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


def power_law(axis: Axes, rows: list[dict[str, Any]], key: str, label: str) -> None:
    """Time against `key` on log axes, with the proportional line through the last point."""
    x, y = [row[key] for row in rows], [row["ms"] for row in rows]
    axis.loglog(x, y, "o-", label="measured")
    axis.loglog(x, [y[-1] * v / x[-1] for v in x], "--", label="proportional")
    axis.set(xlabel=label, ylabel="milliseconds")
    axis.legend()


def against(axis: Axes, rows: list[dict[str, Any]], key: str, label: str) -> None:
    """Time against `key` on linear axes from zero."""
    axis.plot([row[key] for row in rows], [row["ms"] for row in rows], "o-")
    axis.set(xlabel=label, ylabel="milliseconds", ylim=(0, None))


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
