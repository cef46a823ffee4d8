"""How well does a look at a frame tell what each form of method auto reaches, and what it costs?

Refits the constants of `jflnr/auto/plan.py`: they are in results/auto.json then.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, resume
from experiments.data import has
from experiments.results import Parts, Row
from experiments.resume import ROOT
from experiments.tune import quick_psnr
from jflnr.auto import plan as plans
from jflnr.auto.complexity import is_simple
from jflnr.auto.method import denoise_on_blocks

NAME = "auto-predictions"

# The first view of every rendered training scene, beside those of the data folder.
RENDERED = "*_100.exr"
COUNTS = (1, 4)
# Of the standardised arguments; without it five of them on a hundred frames fit noise.
RIDGE = 10.0


def run(quick: bool) -> Parts:
    """Looks, and the PSNR of every form, of training and validation frames."""
    rendered = sorted((ROOT / "cache" / "frames" / "train").glob(RENDERED))
    paths = [data.SHIPPED] if quick else [*data.frames("train", "val"), *rendered]
    keys = [f"{path}:{spp}" for path in paths for spp in COUNTS if has(path, spp)]
    return tables(resume.rows(f"{NAME}{'-quick' * quick}", keys, one))


def one(key: str) -> dict[str, Any]:
    """What each look says of one frame, and what every form reaches."""
    path, spp = key.rsplit(":", 1)
    frame = jflnr.read_frame(path, spp=int(spp))
    row: dict[str, Any] = {"frame": data.label(Path(path)), "spp": int(spp)}
    row |= {"simple": bool(is_simple(frame)), "looks": {}, "psnr": {}}
    for form in plans.BLOCKS:
        image, models = denoise_on_blocks(frame, form)
        row["psnr"][form] = quick_psnr(frame, image)
        if form == plans.start_of(form):
            row["looks"][form] = list(plans.statistics_of(models))
    row["psnr"]["flnr"] = quick_psnr(frame, jflnr.denoise(frame, "flnr"))
    return row


def weights(rows: list[dict[str, Any]], first: str, form: str) -> np.ndarray:
    """The prediction of a form's PSNR from the look of the form `first`, `(6,)`."""
    x, own = arguments(rows, first), reached(rows, first)
    found = _ridge(x, own)
    return found if form == first else found + _ridge(x, reached(rows, form) - own)


def arguments(rows: list[dict[str, Any]], first: str) -> np.ndarray:
    """(1, look) of every row, `(n, 6)`."""
    return np.array([[1.0, *row["looks"][first]] for row in rows])


def reached(rows: list[dict[str, Any]], form: str) -> np.ndarray:
    """PSNR of a form, `(n,)`."""
    return np.array([row["psnr"][form] for row in rows])


def _ridge(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    mean, scale = x[:, 1:].mean(0), np.maximum(x[:, 1:].std(0), 1e-9)
    z = np.column_stack([np.ones(len(x)), (x[:, 1:] - mean) / scale])
    penalty = RIDGE * np.diag([0, *np.ones(len(mean))])
    slopes = np.linalg.solve(z.T @ z + penalty, z.T @ y)
    return np.array([slopes[0] - slopes[1:] / scale @ mean, *(slopes[1:] / scale)])


def tables(rows: list[Row]) -> Parts:
    """The constants, and how good they are on training and validation frames."""
    train = [row for row in rows if not row["frame"].startswith("val")] or rows
    constants, found = [], []
    for first, forms in plans.PREDICTIONS.items():
        own = weights(train, first, first)
        for form in forms:
            fitted = weights(train, first, form)
            constants.append({"looks": first, "predicts": form, "constants": fitted.tolist()})
            added = fitted if form == first else fitted - own
            found += [_error(rows, split, first, form, added) for split in ("train", "val")]
    return {"constants": constants, "predictions": [row for row in found if row]}


def _error(
    rows: list[dict[str, Any]], split: str, first: str, form: str, added: np.ndarray
) -> dict[str, Any]:
    """Of the PSNR of the form that looks, or of what another one adds to it."""
    mine = [row for row in rows if row["frame"].startswith("val") == (split == "val")]
    if len(mine) < 2:
        return {}
    true, told = reached(mine, form), arguments(mine, first) @ added
    if form != first:
        true = true - reached(mine, first)
    return {
        "split": split,
        "looks": first,
        "predicts": "itself" if form == first else f"what {form} adds",
        "mean": float(true.mean()),
        "error": float(np.sqrt(np.mean((true - told) ** 2))),
        "correlation": float(np.corrcoef(true, told)[0, 1]),
    }
