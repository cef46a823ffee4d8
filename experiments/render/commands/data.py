"""`render data`: fills a folder with the frames of a split; stops and resumes at any time."""

from __future__ import annotations

import argparse

from experiments.render import workers
from experiments.render.dataset import evaluation_jobs, fill, training_jobs


def run(arguments: argparse.Namespace) -> None:
    """Render until the folder holds `--frames` frames of the split."""
    split = arguments.split
    jobs = training_jobs() if split == "train" else evaluation_jobs(split)
    say = lambda line: print(line, flush=True)
    if arguments.cluster is None:
        there = fill(arguments.folder, jobs, arguments.frames, say)
    else:
        there = workers.fill(
            arguments.cluster, arguments.folder, jobs, arguments.frames, arguments.threads, say
        )
    print(f"{there} frames of the split {split} in {arguments.folder}")
