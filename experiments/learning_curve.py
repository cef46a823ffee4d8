"""The network against the scenes and views that it learns from: whether more rendering pays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments import data, plots, results, resume, training
from jflnr.network import examples
from jflnr.network.train import CONFIGS, Settings, train

NAME = "learning_curve"
QUESTION = "What do more scenes, and more views of them, bring the network?"
MINUTES = 17

STEPS, EVERY = 1200, 100
# Name of the part: share of the scenes, views of each at most.
PARTS: dict[str, tuple[float, int | None]] = {
    "a quarter of the scenes": (0.25, None),
    "half of the scenes": (0.5, None),
    "all scenes, one view each": (1.0, 1),
    "all scenes, all views": (1.0, None),
}


def run(quick: bool) -> dict[str, Any]:
    """Validation PSNR of flnr-tiny by steps, trained on parts of the frames."""
    paths = training.frames()
    paths = [data.SHIPPED] if quick or not paths else paths
    scenes = np.random.default_rng(0).permutation(sorted({training.scene_of(p) for p in paths}))
    kept = [data.read(path) for path in (paths if quick else data.frames("val"))]
    settings = Settings(widths=CONFIGS["tiny"], every=1 if quick else EVERY)

    def on_part(name: str) -> list[dict[str, Any]]:
        share, views = PARTS[name]
        # Fewer scenes are a part of more, so that the curve is not of one choice against another.
        chosen = scenes[: max(round(share * len(scenes)), 1)]
        by_scene = [[p for p in paths if training.scene_of(p) == scene] for scene in chosen]
        mine = [path for some in by_scene for path in some[:views]]
        crops = [crop for some in examples.read(mine, settings.seed) for crop in some]
        result = train(crops, kept, settings, stop=lambda step: step >= (1 if quick else STEPS))
        facts = {"part": name, "scenes": len(chosen), "frames": len(mine), "crops": len(crops)}
        return [
            facts | {"steps": entry.step, "loss": entry.loss, "psnr": entry.validation}
            for entry in result.history
        ]

    found = resume.rows(f"{NAME}{'-quick' * quick}", list(PARTS)[-1 if quick else 0 :], on_part)
    return {"rows": [row for rows in found for row in rows]}


def draw(result: dict[str, Any], folder: Path) -> None:
    """learning_curve.md: the best and the last of each run; learning_curve.png: the curves."""
    by_part: dict[str, list[dict[str, Any]]] = {}
    for row in result["rows"]:
        by_part.setdefault(row["part"], []).append(row)
    rows = []
    for mine in by_part.values():
        best = max(mine, key=lambda row: row["psnr"])
        rows.append(best | {"untrained": mine[0]["psnr"], "last": mine[-1]["psnr"]})
    columns = {"part": "learns from", "scenes": "scenes", "frames": "frames", "crops": "crops"}
    columns |= {"untrained": "untrained, dB", "psnr": "best, dB", "steps": "at step"}
    plots.write_text(folder / f"{NAME}.md", results.table(rows, columns | {"last": "last, dB"}))
    with plots.figure(folder / f"{NAME}.png") as axis:
        for name, mine in by_part.items():
            axis.plot([row["steps"] for row in mine], [row["psnr"] for row in mine], label=name)
        axis.set(xlabel="steps", ylabel="validation PSNR, dB")
        axis.legend(fontsize=8)
