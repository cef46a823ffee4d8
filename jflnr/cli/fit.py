"""fit: learn the denoiser's parameters on frames that have a reference.

Minimises the mean error of reflected light against the layer `reference`, by gradient through the
whole denoiser, and writes the numbers of the method as JSON for `jflnr denoise --params`.
An OUT that exists is kept, which is no error, unless --overwrite is given.
"""

import argparse
from pathlib import Path

from jflnr.cli.common import guide_names, kept_as_it_is, printable
from jflnr.cli.jobs import check_apart, expand, make_folder
from jflnr.frame import Frame, read_frame
from jflnr.images.guides import choose
from jflnr.methods import method_of
from jflnr.parameters import METHODS, numbers_of, save_parameters

EXAMPLES = """\
  jflnr fit frames/ -o params.json
  jflnr denoise shot/ -o clean/ --params params.json
  jflnr fit frames/ -o adaptive.json --method flr-adaptive --spp 1 4 16
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("frames", metavar="FRAME", nargs="+", type=Path, help="EXR frames, or folders of them")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="JSON file to write")
    measured = "flr, by SMAPE, or flr-adaptive, by PSNR and SMAPE (flr)"
    add("--method", default="flr", choices=METHODS, help=measured)
    noisy = "take the noisy layers indirect_N (1)"
    add("--spp", type=int, nargs="+", default=[1], metavar="N", help=noisy)
    add("--guides", type=guide_names, metavar="A,B", help="guides (normal,depth,ao, if present)")
    add("--block", type=int, help="side of the squares of pixels that share one model")
    add("--steps", type=int, default=40, metavar="N", help="steps of L-BFGS at most (40)")
    add("--overwrite", action="store_true", help="replace OUT if it exists")
    add("-q", "--quiet", action="store_true", help="print nothing but errors")


def run(arguments: argparse.Namespace) -> int:
    from jflnr.fitting import fit

    files = expand(arguments.frames)
    check_apart([arguments.output], files)
    if arguments.output.exists() and not arguments.overwrite:
        print(kept_as_it_is(arguments.output))
        return 0
    frames = [_read(file, spp) for file in files for spp in arguments.spp]
    guides = choose(frames[0], arguments.guides)
    options = {} if arguments.block is None else {"block": arguments.block}
    method = method_of(arguments.method, **options)
    make_folder(arguments.output)
    print(f"frames: {len(frames)}, guides: {', '.join(guides) or 'none'}", flush=True)
    error = "SMAPE" if arguments.method == "flr" else "error"
    say = lambda step, loss: print(f"step {step}: {error} {loss:.5f}", flush=True)
    result = fit(frames, method, guides=guides, steps=arguments.steps, progress=say)
    given = {"guides": list(guides), "block": method.block, "spp": arguments.spp}
    about = given | {"frames": len(frames), "before": result.before, "after": result.after}
    save_parameters(arguments.output, result.method, **about)
    numbers = ", ".join(f"{name} {n:.4g}" for name, n in numbers_of(result.method).items())
    print(
        f"{error} {result.before:.5f} before, {result.after:.5f} after, steps: {result.steps}\n"
        f"{numbers} -> {printable(arguments.output)}"
    )
    return 0


def _read(path: Path, spp: int) -> Frame:
    frame = read_frame(path, spp)
    if frame.reference is None:
        raise ValueError(f"{path}: fitting needs a layer reference, and there is none")
    return frame
