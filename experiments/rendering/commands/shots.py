"""`render shots`: the sequences of the experiment `sequences`, one folder each; resumes."""

from __future__ import annotations

import argparse

from experiments.rendering.commands import one

# Scene, what moves, and where its references stop: one for all frames may cost more.
SHOTS = {
    "room": {"static": 0.02, "switch": 0.03, "light": 0.06, "object": 0.06},
    "cave-7": {"switch": 0.03, "light": 0.06},
    "dining-room": {"static": 0.03, "camera": 0.06},
    "sponza": {"static": 0.02, "camera": 0.06},
    "classroom": {"static": 0.03, "object": 0.06},
    "bathroom2": {"camera": 0.06},
}


def run(arguments: argparse.Namespace) -> None:
    """Render what is not there yet; finished frames are kept."""
    shots = ((scene, *shot) for scene, motions in SHOTS.items() for shot in motions.items())
    for scene, motion, error in shots:
        own = {"scene": scene, "motion": motion, "error": error}
        own["output"] = arguments.folder / f"{scene}_{motion}"
        one.run(argparse.Namespace(**vars(arguments) | own))
