"""python -m experiments list | run NAME... | report | render SCENE..."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments import results

NAMES = (
    "picture",
    "steps",
    "gain",
    "speed",
    "ablation",
    "stability",
    "tune",
    "table1",
    "pareto",
    "spp",
    "regularisation",
    "block",
    "guide_choice",
    "flnr",
    "flnr_spp",
    "paper_form",
    "optimisers",
    "learning_curve",
    "finetune",
    "upsample",
    "lightgroups",
    "figure9",
    "complexity",
    "error_map",
    "criterion",
    "parsimony",
    "predictions",
    "large",
    "throughput",
    "threads",
    "accumulated",
    "sequences",
    "sequence_speed",
    "bmfr",
)


def main(argv: list[str]) -> int:
    if argv[:1] == ["render"]:
        return importlib.import_module("experiments.render.command").main(argv[1:])
    arguments = _parser().parse_args(argv)
    names = NAMES if getattr(arguments, "names", None) in (None, ["all"]) else arguments.names
    try:
        if getattr(arguments, "cluster", None) is not None:
            return _on_cluster(arguments, names)
        for name in names:
            if arguments.command == "list":
                module = _module(name)
                print(f"{name:16}{module.MINUTES:4} min  {module.QUESTION}")
            elif arguments.command == "run":
                results.run(_module(name), arguments.quick, arguments.out)
                results.draw(_module(name), arguments.out, arguments.docs)
            elif (arguments.out / f"{name}.json").exists():
                results.draw(_module(name), arguments.out, arguments.docs)
        if arguments.command == "report":
            importlib.import_module("experiments.report").write(arguments.out, NAMES)
    except (OSError, ValueError) as error:
        print(f"experiments: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _on_cluster(arguments: argparse.Namespace, names: Sequence[str]) -> int:
    """As `run`; an experiment that fails is reported, and the others are done."""
    from experiments import farm

    modules, code = {name: _module(name) for name in names}, 0
    for name, error in farm.run(arguments.cluster, names, arguments.quick, arguments.out):
        if error is None:
            results.draw(modules[name], arguments.out, arguments.docs)
            continue
        print(f"experiments: {name}: {error}", file=sys.stderr)
        code = 2
    return code


def _module(name: str) -> results.Experiment:
    if name not in NAMES:
        raise ValueError(f"{name!r} is none of the experiments: {', '.join(NAMES)}")
    return importlib.import_module(f"experiments.{name}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m experiments", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="the experiments: minutes on two cores, question")
    run = commands.add_parser("run", help="run experiments by name, or all")
    run.add_argument("names", nargs="+", metavar="NAME")
    run.add_argument("--quick", action="store_true", help="a small version, in under a minute")
    run.add_argument(
        "--cluster",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="on a Dask cluster, tcp://HOST:8786; without ADDRESS on this machine's cores",
    )
    report = commands.add_parser("report", help="charts, tables, OUT/report.html from results")
    for command in (run, report):
        command.add_argument("--out", type=Path, default=Path("out"), help="folder of results")
        command.add_argument("--docs", type=Path, help="where charts and tables go (default: OUT)")
    commands.add_parser("render", help="render frames; see `render --help`", add_help=False)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
