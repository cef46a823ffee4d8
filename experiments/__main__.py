"""python -m experiments list | run NAME... | pages | pictures NAME... | report | render SCENE..."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments import results
from experiments.catalogue import NAMES, experiment


def main(argv: list[str]) -> int:
    if argv[:1] == ["render"]:
        return importlib.import_module("experiments.rendering.command").main(argv[1:])
    arguments = _parser().parse_args(argv)
    try:
        return _COMMANDS[arguments.command](arguments)
    except (OSError, ValueError) as error:
        print(f"experiments: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def _list(arguments: argparse.Namespace) -> int:
    for one in map(experiment, NAMES):
        print(f"{one.NAME:16}{one.MINUTES:4} min  {one.QUESTION}")
    return 0


def _run(arguments: argparse.Namespace) -> int:
    names = NAMES if arguments.names == ["all"] else arguments.names
    out = arguments.out or (Path("out") if arguments.quick else results.FOLDER)
    if arguments.cluster is not None:
        return _on_cluster(arguments, names, out)
    for one in [experiment(name) for name in names]:
        results.run(one, arguments.quick, out)
    return 0


def _on_cluster(arguments: argparse.Namespace, names: Sequence[str], out: Path) -> int:
    """As `run`; an experiment that fails is reported, and the others are done."""
    from experiments import farm

    code = 0
    for name, error in farm.run(arguments.cluster, names, arguments.quick, out):
        if error is not None:
            print(f"experiments: {name}: {error}", file=sys.stderr)
            code = 2
    return code


def _pages(arguments: argparse.Namespace) -> int:
    importlib.import_module("experiments.pages").write(arguments.results, arguments.docs)
    return 0


def _pictures(arguments: argparse.Namespace) -> int:
    arguments.docs.mkdir(parents=True, exist_ok=True)
    for name in arguments.names:
        importlib.import_module(f"experiments.pictures.{name}").draw(arguments.docs)
    return 0


def _report(arguments: argparse.Namespace) -> int:
    importlib.import_module("experiments.report").write(arguments.results, Path("out"))
    return 0


_COMMANDS = {
    "list": _list,
    "run": _run,
    "pages": _pages,
    "pictures": _pictures,
    "report": _report,
}


def _parser() -> argparse.ArgumentParser:
    from experiments.pictures import NAMES as PICTURES

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
    run.add_argument("--out", type=Path, help="folder of results (default: results; quick: out)")
    pages = commands.add_parser(
        "pages", help="tables, charts and the figures in pages from results"
    )
    pictures = commands.add_parser("pictures", help="pictures of the pages that show frames")
    pictures.add_argument("names", nargs="+", choices=PICTURES, metavar="NAME")
    report = commands.add_parser("report", help="out/report.html from results")
    for command in (pages, pictures):
        command.add_argument(
            "--docs", type=Path, default=results.ROOT / "docs", help="default: docs"
        )
    for command in (pages, report):
        command.add_argument("--results", type=Path, default=results.FOLDER, metavar="FOLDER")
    commands.add_parser("render", help="render frames; see `render --help`", add_help=False)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
