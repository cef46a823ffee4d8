"""What other solvers make of the cases that they fail on."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from experiments import plots, results
from experiments.stability import SIZE
from experiments.stability.cases import CASES, Case, make
from experiments.stability.measures import passes
from experiments.stability.methods import METHODS, OURS

FILE = "stability_failures.png"


def draw(folder: Path) -> None:
    """stability_failures.png: where methods fail in float32, up to six such cases, and ours."""
    cells = results.parts(results.read(results.FOLDER / "stability.json"))["cells"]
    bad: dict[str, list[str]] = {}
    for cell in cells:
        if cell["precision"] == "float32" and not passes(cell) and cell["method"] not in OURS:
            bad.setdefault(cell["method"], []).append(cell["case"])
    shown = _most_telling(bad)
    methods = [*(m for m in METHODS if m in bad), "ours, Cholesky"]
    size = 1.9, 1.75 * (len(methods) + 1)
    with plots.figure(folder / FILE, columns=len(shown), size=size) as axes:
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


def picture(method: str, case: str) -> tuple[Case, np.ndarray]:
    """A case in float32 and what a method makes of it, `(H, W)`."""
    made = make(case, *SIZE, np.float32)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        return made, METHODS[method](made, np.float32)[..., 0]
