"""`render pictures`: whole pictures with materials of a split; stops and resumes at any time."""

from __future__ import annotations

import argparse

from experiments.rendering.commands.data import TRAINING
from experiments.rendering.dataset import fill, picture_jobs


def run(arguments: argparse.Namespace) -> None:
    """Render until there are `--frames` pictures of the split; by default all of val or test."""
    split = arguments.split
    frames = arguments.frames or (TRAINING if split == "train" else None)
    say = lambda line: print(line, flush=True)
    there = fill(arguments.folder, picture_jobs(split), frames, say)
    print(f"{there} pictures of the split {split}")
