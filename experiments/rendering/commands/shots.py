"""`render shots`: the sequences of the experiment `sequences`, one folder each; resumes."""

from __future__ import annotations

import argparse

from experiments.rendering.commands import one

# Scene, what moves, and where its references stop: one for all frames may cost more.
SHOTS = (
    ("room", "static", 0.02),
    ("room", "switch", 0.03),
    ("room", "light", 0.06),
    ("room", "object", 0.06),
    ("cave-7", "switch", 0.03),
    ("cave-7", "light", 0.06),
    ("dining-room", "static", 0.03),
    ("dining-room", "camera", 0.06),
    ("sponza", "static", 0.02),
    ("sponza", "camera", 0.06),
    ("classroom", "static", 0.03),
    ("classroom", "object", 0.06),
    ("bathroom2", "camera", 0.06),
)


def run(arguments: argparse.Namespace) -> None:
    """Render what is not there yet; finished frames are kept."""
    for scene, motion, error in SHOTS:
        own = {"scene": scene, "motion": motion, "error": error}
        own["output"] = arguments.folder / f"{scene}_{motion}"
        one.run(argparse.Namespace(**vars(arguments) | own))
