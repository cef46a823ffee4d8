"""train: train the network of the method flnr on frames of your own.

FRAMES need the layers that `jflnr denoise` needs, ao, several noisy layers (indirect_1,
indirect_1_b, indirect_2, ...) and `reference`; without references, two noisy layers of as many
samples each. Folders are searched for .exr files. OUT is a file of weights for
`jflnr denoise --method flnr --params OUT`. Beside it OUT.state holds the run, which goes on from
there when the command is given again, and OUT.png the curves, where matplotlib is installed.
"""

import argparse
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jflnr.cli.jobs import check_apart, expand, make_folder

if TYPE_CHECKING:
    from jflnr.network.train import Progress, Result, Settings

UNITS = {"s": 1, "m": 60, "h": 3600}

EXAMPLES = """\
  jflnr train --data frames/ --val kept/ -o weights.npz --time 3h
  jflnr denoise shot/ -o clean/ --method flnr --params weights.npz
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--data", metavar="FRAMES", nargs="+", type=Path, required=True, help="frames, folders")
    add("--val", metavar="FRAMES", nargs="+", type=Path, default=[], help="frames to choose by")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help=".npz file to write")
    add("--config", default="base", help="tiny, small or base: the size of the network (base)")
    add("--time", type=seconds, default="1h", metavar="T", help="how long, such as 90s or 3h (1h)")
    add("--steps", type=int, metavar="N", help="stop after N steps at the latest")
    add("--batch", type=int, default=4, metavar="N", help="crops per step (4)")
    add("--rate", type=float, default=1e-3, help="size of the first steps (0.001)")
    add("--every", type=int, default=500, metavar="N", help="steps between validations (500)")
    add("--seed", type=int, default=0, help="of everything random (0)")
    add("--finetune", type=Path, metavar="FILE", help="start from these weights")
    add("--overwrite", action="store_true", help="replace OUT and its state if they exist")


def seconds(text: str) -> float:
    """`90s`, `45m` or `3h` in seconds."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh])", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no time such as 90s, 45m or 3h")
    return float(match[1]) * UNITS[match[2]]


def run(arguments: argparse.Namespace) -> int:
    from jflnr import checks
    from jflnr.network import examples, weights
    from jflnr.network.train import CONFIGS, Settings, train

    checks.choice("--config", arguments.config, tuple(CONFIGS))
    for name in ("batch", "every"):
        checks.positive_integer(f"--{name}", getattr(arguments, name))
    state = arguments.output.with_name(arguments.output.name + ".state")
    paths, kept = expand(arguments.data), expand(arguments.val)
    outputs = [arguments.output, state, arguments.output.with_suffix(".png")]
    check_apart(outputs, [*paths, *kept, arguments.finetune])
    if arguments.output.exists() and not state.exists() and not arguments.overwrite:
        print(f"{arguments.output} kept as it is; --overwrite replaces it")
        return 0
    make_folder(arguments.output)
    if arguments.overwrite:
        state.unlink(missing_ok=True)
    found = _read(paths, arguments.seed)
    validation = _validation(kept)
    initial, widths = None, CONFIGS[arguments.config]
    if arguments.finetune is not None:
        initial, header = weights.load(arguments.finetune)
        widths = tuple(header["widths"])
    settings = Settings(
        widths=widths,
        seed=arguments.seed,
        batch=arguments.batch,
        rate=arguments.rate,
        every=arguments.every,
        noisy_targets=not examples.has_reference(paths[0]),
    )
    clock = _Clock(arguments.time, arguments.steps)
    result = train(
        found,
        validation,
        settings,
        initial=initial,
        state_file=state,
        stop=clock.over,
        report=clock.report,
    )
    _write(arguments.output, result, settings, paths, len(found))
    print(f"best: step {result.best.step}, {result.best.validation:.2f} dB -> {arguments.output}")
    return 0


def _read(paths: Sequence[Path], seed: int) -> list:
    from tqdm import tqdm

    from jflnr.network import examples

    found = []
    for some in tqdm(examples.read(paths, seed), "reading", len(paths), leave=False, disable=None):
        found += some
    print(f"frames: {len(paths)}, crops: {len(found)}", flush=True)
    return found


def _validation(paths: Sequence[Path]) -> list:
    from jflnr.frame import read_frame

    frames = [read_frame(path) for path in paths]
    if any(frame.reference is None for frame in frames):
        raise ValueError("--val: every frame needs a layer reference")
    return frames


class _Clock:
    """Tells when to stop, and reports what is left. limit: seconds. steps: at most, or None."""

    def __init__(self, limit: float, steps: int | None) -> None:
        self.start, self.limit, self.steps = time.monotonic(), limit, steps

    def over(self, step: int) -> bool:
        done = self.steps is not None and step >= self.steps
        return done or time.monotonic() - self.start > self.limit

    def report(self, progress: "Progress") -> None:
        left = max(self.limit - (time.monotonic() - self.start), 0) / 60
        print(
            f"step {progress.step}: loss {progress.loss:.3f}, validation "
            f"{progress.validation:.3f} dB, {left:.0f} minutes left",
            flush=True,
        )


def _write(
    output: Path, result: "Result", settings: "Settings", paths: Sequence[Path], count: int
) -> None:
    from jflnr.network import examples, weights

    weights.save(
        output,
        result.params,
        settings.widths,
        frames=len(paths),
        crops=count,
        data=examples.digest(paths),
        steps=result.best.step,
        validation_psnr=round(result.best.validation, 3),
    )
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return
    figure = Figure(figsize=(6, 4), layout="constrained")
    loss, psnr = figure.subplots(2, sharex=True)
    steps = [entry.step for entry in result.history]
    loss.plot(steps, [entry.loss for entry in result.history])
    psnr.plot(steps, [entry.validation for entry in result.history])
    loss.set(ylabel="training loss")
    psnr.set(ylabel="validation PSNR, dB", xlabel="steps")
    figure.savefig(output.with_suffix(".png"))
