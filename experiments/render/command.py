"""`python -m experiments render SCENE ...`: renders frames of our scenes, or of any Mitsuba XML."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from experiments.render import backend
from experiments.render.progress import Progress


def main(argv: list[str]) -> int:
    """Render as the arguments say; the exit status."""
    arguments = _parser().parse_args(argv)
    try:
        variant = backend.start(arguments.threads)
        return _render(arguments, variant)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="experiments render", description=__doc__)
    parser.add_argument("scene", help="a scene of ours (room, ...), or a Mitsuba scene.xml")
    parser.add_argument("-o", "--output", type=Path, required=True, help="EXR file to write")
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--height", type=int, default=270)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--error", type=float, default=0.03, help="of the reference")
    parser.add_argument("--minutes", type=float, default=20, help="at most, for the reference")
    parser.add_argument("--leave-out", nargs="*", default=[], help="layers not to write")
    parser.add_argument("--threads", type=int, help="CPU threads; all by default")
    parser.add_argument("--overwrite", action="store_true")
    return parser


def _render(arguments: argparse.Namespace, variant: str) -> int:
    from experiments.render import frame
    from experiments.render.camera import Camera
    from experiments.render.reference import Goal
    from experiments.render.scene import build
    from experiments.scenes.room import room

    world = room()
    view = world.view
    assert view is not None
    settings = frame.Settings(
        arguments.width,
        arguments.height,
        arguments.seed,
        direct_spp=256,
        goal=Goal(arguments.error, seconds=60 * arguments.minutes),
    )
    camera = Camera.looking(view.origin, view.target, view.fov_x)
    state = Path("cache/state") / f"{arguments.output.stem}.npz"
    with Progress(arguments.output.name) as progress:
        layers, facts = frame.render(
            build(world), camera, settings, world.ao_distance, state, progress
        )
    facts = {"scene": arguments.scene, "view": 0, "split": "train", "variant": variant} | facts
    frame.write(arguments.output, layers, facts, tuple(arguments.leave_out))
    print(facts)
    return 0
