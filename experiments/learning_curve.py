"""The network against the number of scenes it learns from: whether more rendering pays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import numpy as np

from experiments import data, plots, results, resume, training
from jflnr.flnr import regression
from jflnr.flnr.adam import Adam
from jflnr.flnr.train import CONFIGS, Settings, Validation, rate_of

NAME = "learning_curve"
QUESTION = "What do more scenes to learn from bring the network?"
MINUTES = 60

SECONDS = 25.0
SHARES = (0.25, 0.5, 1.0)


def run(quick: bool) -> dict[str, Any]:
    """Validation PSNR of flnr-tiny for shares of the scenes, each trained for equal time."""
    paths = training.frames()
    paths = [data.SHIPPED] if quick or not paths else paths
    scenes = np.random.default_rng(0).permutation(sorted({training.scene_of(p) for p in paths}))
    score = Validation([data.read(path) for path in (paths if quick else data.frames("val"))])
    initial = regression.init(jax.random.key(0), CONFIGS["tiny"])

    def on_share(share: str) -> list[dict[str, Any]]:
        # Fewer scenes are a part of more, so that the curve is not of one choice against another.
        chosen = scenes[: max(round(float(share) * len(scenes)), 1)]
        mine = [path for path in paths if training.scene_of(path) in chosen]
        known = training.pool(mine, 1)
        solver = Adam(training.objective, rate_of(Settings()))
        batch = min(training.BATCH, training.count(known))
        steps = training.descend(solver, initial, known, batch, 0.5 if quick else SECONDS)
        facts = {"scenes": len(chosen), "crops": training.count(known)}
        return [facts | {"steps": n, "psnr": score(params)} for _, n, params in steps]

    shares = [str(share) for share in (SHARES[-1:] if quick else SHARES)]
    found = resume.rows(f"{NAME}{'-quick' * quick}", shares, on_share)
    return {"rows": [row for rows in found for row in rows]}


def draw(result: dict[str, Any], folder: Path) -> None:
    """learning_curve.md: the best and the last of each run; learning_curve.png: the curves."""
    by_scenes: dict[int, list[dict[str, Any]]] = {}
    for row in result["rows"]:
        by_scenes.setdefault(row["scenes"], []).append(row)
    rows = []
    for scenes, mine in by_scenes.items():
        best = max(mine, key=lambda row: row["psnr"])
        rows.append(
            {"scenes": scenes, "crops": best["crops"], "untrained": mine[0]["psnr"]}
            | {"best": best["psnr"], "at": best["steps"], "last": mine[-1]["psnr"]}
        )
    columns = {"scenes": "scenes", "crops": "crops", "untrained": "untrained, dB"}
    columns |= {"best": "best, dB", "at": "at step", "last": "last, dB"}
    plots.write_text(folder / f"{NAME}.md", results.table(rows, columns))
    with plots.figure(folder / f"{NAME}.png") as axis:
        for scenes, mine in by_scenes.items():
            label = f"{scenes} scenes"
            axis.plot([row["steps"] for row in mine], [row["psnr"] for row in mine], label=label)
        axis.set(xlabel="steps", ylabel="validation PSNR, dB")
        axis.legend(fontsize=8)
