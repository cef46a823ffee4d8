"""`render families`: one scene of each family at 320 x 180, on a contact sheet; resumes."""

from __future__ import annotations

import argparse

from PIL import Image

from experiments.rendering import frame
from experiments.rendering.dataset import Job, fill
from experiments.rendering.scenes.catalogue import FAMILIES
from experiments.rendering.sheet import contact_sheet, tone_mapped
from experiments.rendering.source import RANDOM


def run(arguments: argparse.Namespace) -> None:
    """Render the scene `--seed` of every family as training frames, and write the sheet."""
    jobs = [Job(f"{family}-{arguments.seed}", RANDOM, 320, 180) for family in FAMILIES]
    fill(arguments.folder, iter(jobs), None, lambda line: print(line, flush=True))
    paths = {job.scene: arguments.folder / job.name for job in jobs}
    pictures = [(n, tone_mapped(frame.read(p)[0])) for n, p in paths.items() if p.exists()]
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    page = contact_sheet(pictures, 4).quantize(256, dither=Image.Dither.NONE)  # a third of the size
    page.save(arguments.output, optimize=True)
    print(f"wrote {arguments.output}")
