"""train: train the network of the methods flnr and flnr-picture on frames of your own.

FRAMES need the layers that `jflnr denoise` needs, several noisy layers (indirect_1, indirect_1_b,
indirect_4, ...; of whole pictures beauty_1, ... and their auxiliary layers) and `reference`, or
`target`, what to learn instead. Folders are searched for .exr files. OUT is a file of weights for
`jflnr denoise --method flnr --params OUT`. Beside it OUT.state
holds the run, which goes on from there when the command is given again, and OUT.png the curves,
where matplotlib is installed. After Ctrl-C, OUT and OUT.state are written too. The frames under
about twenty realisations of their noise are kept in the folder of --cache, 17 MB for 320 x 184
pixels, 60 MB for pictures.
"""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jflnr import checks
from jflnr.cli.common import kept_as_it_is, printable
from jflnr.cli.jobs import check_apart, expand, make_folder
from jflnr.files import replacing
from jflnr.methods import method_of

if TYPE_CHECKING:
    from jflnr.network.train import Progress, Result, Settings

TRAINED = ("flnr", "flnr-small", "flnr-picture")
UNITS = {"s": 1, "m": 60, "h": 3600}

EXAMPLES = """\
  jflnr train --data frames/ --val kept/ -o weights.npz --time 1h
  jflnr denoise shot/ -o clean/ --method flnr --params weights.npz
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--data", metavar="FRAMES", nargs="+", type=Path, required=True, help="frames, folders")
    add("--val", metavar="FRAMES", nargs="+", type=Path, default=[], help="frames to choose by")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help=".npz file to write")
    add("--method", default="flnr", metavar="M", help=f"{', '.join(TRAINED)} (flnr)")
    add("--time", type=seconds, default="1h", metavar="T", help="how long, such as 90s or 3h (1h)")
    add("--steps", type=int, metavar="N", help="stop after N steps at the latest")
    add("--batch", type=int, default=8, metavar="N", help="crops per step (8)")
    add("--rate", type=float, default=2e-3, help="size of the first steps (0.002)")
    add("--every", type=int, default=500, metavar="N", help="steps between validations (500)")
    add("--seed", type=int, default=0, help="of everything random (0)")
    add("--cache", type=Path, metavar="DIR", help="for prepared frames (OUT.frames)")
    add("--overwrite", action="store_true", help="replace OUT and its state if they exist")


def seconds(text: str) -> float:
    """`90s`, `45m` or `3h` in seconds."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh])", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no time such as 90s, 45m or 3h")
    return float(match[1]) * UNITS[match[2]]


def run(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    from jflnr.network import examples
    from jflnr.network.train import WIDTHS, Settings, train

    checks.choice("--method", arguments.method, TRAINED)
    for name in ("batch", "every"):
        checks.positive_integer(f"--{name}", getattr(arguments, name))
    output: Path = arguments.output
    state = output.with_name(output.name + ".state")
    paths, kept = expand(arguments.data), expand(arguments.val)
    check_apart([output, state, output.with_suffix(".png")], [*paths, *kept])
    if output.exists() and not state.exists() and not arguments.overwrite:
        print(kept_as_it_is(output))
        return 0
    make_folder(output)
    if arguments.overwrite:
        state.unlink(missing_ok=True)
    folder = arguments.cache or output.with_name(output.name + ".frames")
    method = method_of(arguments.method)
    print(f"frames: {len(paths)}", flush=True)
    shown = tqdm(paths, "preparing", leave=False, disable=None)
    records = [examples.prepared(path, folder, method) for path in shown]
    given = {name: getattr(arguments, name) for name in ("seed", "batch", "rate", "every")}
    settings = Settings(method=method, widths=WIDTHS[arguments.method], **given)
    print("compiling, which may take minutes", flush=True)
    most = {"seconds": arguments.time, "steps": arguments.steps or float("inf")}
    result = train(records, kept, settings, state_file=state, report=_report, **most)
    _write(output, result, settings, paths)
    print(f"best: step {result.best.step}{_decibels(result.best)} -> {printable(output)}")
    if result.stopped:
        print("stopped; the same command goes on from here", flush=True)
        raise KeyboardInterrupt
    return 0


def _report(progress: "Progress") -> None:
    step = f"step {progress.step}, {progress.seconds / 60:.1f} minutes: loss {progress.loss:.3f}"
    print(f"{step}{_decibels(progress)}", flush=True)


def _decibels(progress: "Progress") -> str:
    return "".join(f", {psnr:.2f} dB at {spp} spp" for spp, psnr in progress.validation.items())


def _write(output: Path, result: "Result", settings: "Settings", paths: Sequence[Path]) -> None:
    from jflnr.network import examples, weights

    weights.save(
        output,
        result.params,
        settings.widths,
        settings.method.read,
        frames=len(paths),
        scenes=len({path.stem.rsplit("_", 1)[0] for path in paths}),
        data=examples.digest(paths),
        steps=result.best.step,
        seconds=round(result.best.seconds),
        validation_psnr={spp: round(v, 3) for spp, v in result.best.validation.items()},
    )
    if result.stopped:  # there is no time for curves
        return
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return
    figure = Figure(figsize=(6, 4), layout="constrained")
    loss, psnr = figure.subplots(2, sharex=True)
    steps = [entry.step for entry in result.history]
    loss.plot(steps, [entry.loss for entry in result.history])
    psnr.plot(steps, [entry.score for entry in result.history])
    loss.set(ylabel="training loss")
    psnr.set(ylabel="validation PSNR, dB", xlabel="steps")
    with replacing(output.with_suffix(".png")) as beside:
        figure.savefig(beside)
