"""`render families`: one scene of each family at 320 x 180, on a contact sheet."""

from __future__ import annotations

import argparse

from experiments.render import frame
from experiments.render.progress import Progress
from experiments.render.reference import Goal
from experiments.render.sheet import contact_sheet, tone_mapped
from experiments.render.source import RANDOM, load
from experiments.scenes.catalogue import FAMILIES


def run(arguments: argparse.Namespace) -> None:
    """Render the scene `--seed` of every family and write the sheet."""
    goal = Goal(arguments.error, seconds=arguments.seconds)
    settings = frame.Settings(320, 180, direct_spp=64, goal=goal)
    pictures = []
    with Progress("families") as progress:
        for number, family in enumerate(FAMILIES):
            name = f"{family}-{arguments.seed}"
            progress(number / len(FAMILIES), name)
            source = load(name)
            view = source.view(RANDOM)
            if view is None:
                print(f"{name}: no valid view")
                continue
            layers, facts = frame.render(source.scene, view[0], settings, view[1])
            pictures.append((name, tone_mapped(layers)))
            error = facts["reference_median_relative_standard_error"]
            speed = facts["reference_samples_per_processor_second"] / 1e6
            print(
                f"{name}: error {error:.3f}, {speed:.2f} million samples/core-s",
                flush=True,
            )
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    contact_sheet(pictures).save(arguments.output)
    print(f"wrote {arguments.output}")
