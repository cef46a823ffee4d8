"""`python -m experiments render`: frames of our scenes or of any Mitsuba 3 XML, and data sets.

render SCENE -o FILE.exr     one view of `room`, `FAMILY-SEED`, a shared scene, or an XML file
render SCENE -o FOLDER --views N        its camera where it has one, else N random views
render SCENE -o FOLDER --motion MOTION --frames N      a sequence
render again FRAME.exr -o FILE.exr       a finished frame once more, as its header says
render families [-o docs/scenes.png]    one scene of each family on a contact sheet
render data [--split train|val|test] [--frames N]       the data set; resumes
render pictures [--split ...] [--frames N]      whole pictures with materials; resumes
render targets [--folder cache/frames]  what training frames are trained on; resumes
render shots [--folder cache/sequences]         those of the experiment `sequences`; resumes
render statistics [-o docs/scene_statistics.png]        1-spp statistics against real rooms
render efficiency [SCENE...]            samples a second, variance x seconds of each sampling
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

from experiments.rendering import backend

VERBS = ("again", "families", "data", "pictures", "targets", "shots", "statistics", "efficiency")
MOTIONS = ("static", "camera", "light", "switch", "object")


def main(argv: list[str]) -> int:
    """Do as the arguments say; the exit status: 0, or 2 with one sentence on what is wrong."""
    verb = argv[0] if argv and argv[0] in VERBS else "one"
    arguments = _parser(verb).parse_args(argv if verb == "one" else argv[1:])
    try:
        backend.start(arguments.threads)
        # Modules that use Mitsuba's types can only be loaded once its variant is set.
        importlib.import_module(f"experiments.rendering.commands.{verb}").run(arguments)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    return 0


def _parser(verb: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments render",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--threads", type=int, help="CPU threads; all by default")
    {
        "one": _one,
        "again": _again,
        "families": _families,
        "data": _data,
        "pictures": _pictures,
        "targets": _targets,
        "shots": _shots,
        "statistics": _statistics,
        "efficiency": _efficiency,
    }[verb](parser)
    return parser


def _one(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", help="room, FAMILY-SEED (stairs-3), a shared scene, or an XML")
    parser.add_argument("-o", "--output", type=Path, required=True, help="EXR file, or a folder")
    parser.add_argument("--motion", choices=MOTIONS, help="a sequence of this")
    parser.add_argument("--error", type=float, default=0.02, help="goal of the reference")
    _rendering(parser)


def _shots(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=Path("cache/sequences"))
    _rendering(parser)
    parser.set_defaults(width=320, height=180, direct_spp=64, minutes=6)


def _rendering(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=360)
    parser.add_argument("--seed", type=int, default=0, help="of the noise and of random views")
    parser.add_argument("--view", type=int, help="0: the scene's own; from 100 on: random")
    parser.add_argument("--views", type=int, help="so many random views, into a folder")
    parser.add_argument("--spp", type=int, nargs="+", default=[1], help="sample counts, 1..64")
    parser.add_argument("--realisations", type=int, default=1, help="of 1 spp")
    parser.add_argument("--bounces", type=int, default=1, help="of indirect light")
    parser.add_argument("--nee-only", action="store_true", help="without MIS: 4 rays a sample")
    parser.add_argument("--ao-distance", type=float, help="in scene units")
    parser.add_argument("--direct-spp", type=int, default=256)
    parser.add_argument("--reference-spp", type=int, help="exactly so many, whatever the error")
    parser.add_argument("--minutes", type=float, default=40, help="of a processor, for a reference")
    parser.add_argument("--leave-out", nargs="*", default=[], metavar="LAYER")
    parser.add_argument("--frames", type=int, default=20, help="of a sequence")


def _again(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("frame", type=Path, help="a frame rendered here or of `shared/data`")
    parser.add_argument("-o", "--output", type=Path, required=True, help="EXR file")
    parser.add_argument("--error", type=float, help="of the reference; by default as many samples")
    parser.add_argument("--minutes", type=float, default=40, help="of a processor, with --error")


def _families(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/scenes.png"))
    parser.add_argument("--seed", type=int, default=2001, help="of the scenes")
    parser.add_argument("--folder", type=Path, default=Path("cache/frames"))


def _pictures(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=Path("cache/whole"))
    _split(parser)


def _split(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--frames", type=int, help="so many; 400 of train, all of val and test")
    parser.add_argument("--split", choices=("train", "val", "test"), default="train")


def _data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=Path("cache/frames"))
    _split(parser)
    parser.add_argument(
        "--cluster",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="on a Dask cluster, tcp://HOST:8786; without ADDRESS on this machine's cores",
    )


def _targets(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=Path("cache/frames"))


def _statistics(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=Path("cache/frames"))
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/scene_statistics.png"))


def _efficiency(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", default=["room", "furnished-1", "lamps-1"])
    parser.add_argument("--spp", type=int, default=64)
