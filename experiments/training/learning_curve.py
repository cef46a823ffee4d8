"""The network against the scenes and views that it learns from: whether more rendering pays."""

from __future__ import annotations

import numpy as np

from experiments import data, resume
from experiments.results import Parts, Row
from experiments.training import shared
from jflnr.network import examples
from jflnr.network.train import CONFIGS, Settings, train

NAME = "training-learning_curve"

STEPS, EVERY = 1200, 100
# Name of the part: share of the scenes, views of each at most.
PARTS: dict[str, tuple[float, int | None]] = {
    "a quarter of the scenes": (0.25, None),
    "half of the scenes": (0.5, None),
    "all scenes, one view each": (1.0, 1),
    "all scenes, all views": (1.0, None),
}


def run(quick: bool) -> Parts:
    """Validation PSNR of flnr-tiny, trained on parts of the frames."""
    paths = shared.frames()
    paths = [data.SHIPPED] if quick or not paths else paths
    scenes = np.random.default_rng(0).permutation(sorted({shared.scene_of(p) for p in paths}))
    kept = [data.read(path) for path in (paths if quick else data.frames("val"))]
    settings = Settings(widths=CONFIGS["tiny"], every=1 if quick else EVERY)

    def on_part(name: str) -> Row:
        share, views = PARTS[name]
        # Fewer scenes are a part of more, so that the curve is not of one choice against another.
        chosen = scenes[: max(round(share * len(scenes)), 1)]
        by_scene = [[p for p in paths if shared.scene_of(p) == scene] for scene in chosen]
        mine = [path for some in by_scene for path in some[:views]]
        crops = [crop for some in examples.read(mine, settings.seed) for crop in some]
        result = train(crops, kept, settings, stop=lambda step: step >= (1 if quick else STEPS))
        facts = {
            "learns from": name,
            "scenes": len(chosen),
            "frames": len(mine),
            "crops": len(crops),
        }
        best = max(result.history, key=lambda entry: entry.validation)
        first, last = result.history[0], result.history[-1]
        found = {"untrained, dB": first.validation, "best, dB": best.validation}
        return facts | found | {"at step": best.step, "last, dB": last.validation}

    names = list(PARTS)[-1 if quick else 0 :]
    return {"scenes and views": resume.rows(f"{NAME}{'-quick' * quick}", names, on_part)}
