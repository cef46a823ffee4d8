"""completion: print a script with which a shell completes `jflnr` on the tab key."""

import argparse
from collections.abc import Iterator
from pathlib import Path

EXAMPLES = """\
  jflnr completion bash > ~/.local/share/bash-completion/completions/jflnr
  jflnr completion zsh > ~/.zfunc/_jflnr       a folder that is in $fpath
  jflnr completion tcsh > ~/.jflnr.tcsh        to be sourced from ~/.tcshrc
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "shell", metavar="SHELL", choices=("bash", "zsh", "tcsh"), help="bash, zsh or tcsh"
    )


def run(arguments: argparse.Namespace) -> int:
    import shtab

    from jflnr.cli import parser

    whole = parser()
    for action in _actions(whole):
        if action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(whole, arguments.shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Every argument of the parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
