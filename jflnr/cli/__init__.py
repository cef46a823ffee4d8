"""The command `jflnr`: one file per subcommand.

Exit codes: 0 done, 2 something is wrong with what was asked or given, 3 some frames failed, 130
interrupted. Modules here import JAX, and what imports it, inside the functions that run it, so that
`--help` and `info` answer at once.
"""

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Iterator, Sequence
from typing import NoReturn

from jflnr import __version__
from jflnr.cli import completion, denoise, doctor, fit, info, metrics, report, train, view
from jflnr.cli.common import INPUT_ERRORS, printable, sentence, tinted

EXAMPLES = """\
  jflnr info render.exr                       what is in it, and what would be denoised
  jflnr denoise render.exr -o out/ --png      the clean picture, and a preview to look at
"""

MODULES = (denoise, info, metrics, report, view, fit, train, doctor, completion)
COMMANDS = {module.__name__.rpartition(".")[2]: module for module in MODULES}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (default: the process's own) and return its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # letters that a terminal lacks, by number
            stream.reconfigure(errors="backslashreplace")
    arguments = parser().parse_args(argv)
    try:
        with open(os.devnull, "w") as nowhere:
            quiet = getattr(arguments, "quiet", False)
            with contextlib.redirect_stdout(nowhere if quiet else sys.stdout):
                code = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        with contextlib.suppress(OSError):
            print("jflnr: interrupted; no partial file is left", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `jflnr info ... | head`
        _drop_output()
        return 0
    except INPUT_ERRORS as error:
        print(f"{tinted('jflnr:', 'red', sys.stderr)} {sentence(error)}", file=sys.stderr)
        _drop_output()
        return 2


def _drop_output() -> None:
    """Say what is left if that can be done; Python would complain of it once more while exiting."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """An ArgumentParser that answers a wrong command line with one sentence."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {printable(message)} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    whole = _Parser(
        prog="jflnr",
        description="Denoise path-traced global illumination.",
        epilog=f"examples:\n{EXAMPLES}\n`jflnr COMMAND --help` says what a command takes.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    whole.add_argument("--version", action="version", version=__version__)
    commands = whole.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, module in COMMANDS.items():
        description = (module.__doc__ or "").partition(": ")[2]
        command = commands.add_parser(
            name,
            help=description.partition("\n")[0],
            description=description,
            epilog=f"examples:\n{module.EXAMPLES}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return whole
