"""`render data`: fills a folder with the frames of a split; stops and resumes at any time."""

from __future__ import annotations

import argparse

from experiments.rendering import workers
from experiments.rendering.dataset import ERROR, evaluation_jobs, fill, training_jobs
from experiments.rendering.manifest import Manifest

TRAINING = 400  # frames, unless the arguments say how many


def run(arguments: argparse.Namespace) -> None:
    """Render until there are `--frames` frames of the split; by default all of val or test."""
    split = arguments.split
    if split == "train":
        jobs, frames = training_jobs(), arguments.frames or TRAINING
    else:
        every = list(evaluation_jobs(split))
        jobs, frames = iter(every), arguments.frames or len(every)
    say = lambda line: print(line, flush=True)
    if arguments.cluster is None:
        fill(arguments.folder, jobs, frames, say)
    else:
        threads = arguments.threads
        workers.fill(arguments.cluster, arguments.folder, jobs, frames, threads, say)
    print(Manifest(arguments.folder).summary(split, ERROR))
