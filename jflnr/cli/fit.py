"""fit: learn the denoiser's parameters on frames with a reference, and write them as JSON.

Minimises SMAPE against the layer `reference` through the whole denoiser. The file is what
`jflnr denoise --params` reads.
"""

import argparse
from pathlib import Path

from jflnr.cli.common import guide_names
from jflnr.cli.jobs import expand


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("frames", metavar="FRAME", nargs="+", type=Path, help="EXR frames, or folders of them")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="JSON file to write")
    add("--spp", type=int, default=1, metavar="N", help="take the noisy layer indirect_N (1)")
    add("--guides", type=guide_names, metavar="A,B", help="guides (normal,depth,ao, if present)")
    add("--block", type=int, default=8, help="side of the squares that share one model (8)")
    add("--overwrite", action="store_true", help="replace OUT if it exists")


def run(arguments: argparse.Namespace) -> int:
    raise NotImplementedError(expand)
