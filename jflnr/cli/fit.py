"""fit: learn the denoiser's parameters on frames that have a reference.

Minimises the mean SMAPE of reflected light against the layer `reference`, by gradient through the
whole denoiser, and writes sigma, eps and eps_prime as JSON for `jflnr denoise --params`.
An OUT that exists is kept, which is no error, unless --overwrite is given.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jflnr.cli.common import guide_names
from jflnr.cli.jobs import expand, make_folder

if TYPE_CHECKING:
    from jflnr.frame import Frame


EXAMPLES = """\
  jflnr fit frames/ -o params.json
  jflnr denoise shot/ -o clean/ --params params.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("frames", metavar="FRAME", nargs="+", type=Path, help="EXR frames, or folders of them")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="JSON file to write")
    add("--spp", type=int, default=1, metavar="N", help="take the noisy layer indirect_N (1)")
    add("--guides", type=guide_names, metavar="A,B", help="guides (normal,depth,ao, if present)")
    add("--block", type=int, help="side of the squares of pixels that share one model")
    add("--steps", type=int, default=40, metavar="N", help="steps of L-BFGS at most (40)")
    add("--overwrite", action="store_true", help="replace OUT if it exists")
    add("-q", "--quiet", action="store_true", help="print nothing but errors")


def run(arguments: argparse.Namespace) -> int:
    from jflnr.denoising import BLOCK
    from jflnr.fitting import fit
    from jflnr.flr.parameters import save_parameters
    from jflnr.guides import choose

    if arguments.output.exists() and not arguments.overwrite:
        print(f"{arguments.output} kept as it is; --overwrite replaces it")
        return 0
    frames = [_read(file, arguments.spp) for file in expand(arguments.frames)]
    guides = choose(frames[0], arguments.guides)
    block = BLOCK if arguments.block is None else arguments.block
    make_folder(arguments.output)
    print(f"frames: {len(frames)}, guides: {', '.join(guides) or 'none'}", flush=True)
    result = fit(frames, guides=guides, block=block, steps=arguments.steps, progress=_progress)
    save_parameters(
        arguments.output,
        result.parameters,
        guides=list(guides),
        block=block,
        spp=arguments.spp,
        frames=len(frames),
        smape_before=result.before,
        smape_after=result.after,
    )
    model = result.parameters
    print(
        f"SMAPE {result.before:.5f} before, {result.after:.5f} after, steps: {result.steps}\n"
        f"sigma {float(model.sigma):.4g}, eps {float(model.eps):.4g}, "
        f"eps_prime {float(model.eps_prime):.4g} -> {arguments.output}"
    )
    return 0


def _read(path: Path, spp: int) -> "Frame":
    from jflnr.frame import read_frame

    frame = read_frame(path, spp)
    if frame.reference is None:
        raise ValueError(f"{path}: fitting needs a layer reference, and there is none")
    return frame


def _progress(step: int, smape: float) -> None:
    print(f"step {step}: SMAPE {smape:.5f}", flush=True)
