"""What several commands share: how errors read, how numbers are shown."""

import argparse
import contextlib
import json
import math
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from jflnr.metrics import LABELS

# What the library raises for wrong input. Anything else is a defect and keeps its traceback.
INPUT_ERRORS = (OSError, ValueError, TypeError, ImportError, MemoryError)

# The exit code where some frames failed and others are done.
SOME_FAILED = 3

COLOURS, COLOUR = {"red": 31, "yellow": 33}, re.compile("\033\\[\\d*m")


def sentence(error: BaseException) -> str:
    """The message of an input error, as one line."""
    if isinstance(error, OSError) and error.strerror:
        named = "" if error.filename is None else f"{error.filename}: "
        return printable(f"{named}{error.strerror.lower()}")
    return printable(str(error).strip()) or type(error).__name__


def printable(text: object) -> str:
    """`text` in one line, with what a terminal would obey in names of files and layers escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in str(text))


def refuse(arguments: argparse.Namespace, options: Iterable[str], why: str) -> None:
    """Raise ValueError, `why` behind the option, if one of the options is given."""
    for option in options:
        if (value := getattr(arguments, option)) is not None and value is not False:
            raise ValueError(f"--{option.replace('_', '-')} {why}")


def kept_as_it_is(*paths: str | Path) -> str:
    """What is said of outputs that are there."""
    return f"{' and '.join(map(printable, paths))} kept as it is; --overwrite replaces it"


@contextlib.contextmanager
def voices() -> Iterator[tuple[TextIO, TextIO]]:
    """stdout and stderr that are heard also while a thread has OpenEXR's own remarks silenced."""
    if sys.stderr is not sys.__stderr__:
        yield sys.stdout, sys.stderr
        return
    with open(os.dup(2), "w", buffering=1, errors="backslashreplace") as err:
        yield sys.stdout, err


def tinted(text: str, colour: str, stream: TextIO) -> str:
    """`text` in `colour` if `stream` is a terminal that shows colours (https://no-color.org)."""
    plain = "NO_COLOR" in os.environ or os.environ.get("TERM") == "dumb"
    if plain or not stream.isatty():
        return text
    return f"\033[{COLOURS[colour]}m{text}\033[0m"


def add_map(parser: argparse.ArgumentParser) -> None:
    """The option `--map`, whose values arrive as pairs."""
    parser.add_argument(
        "--map",
        type=_pair,
        action="append",
        default=[],
        metavar="LAYER=WHERE",
        help="take LAYER from the file's layer, channels or other file WHERE (docs/layouts.md)",
    )


def _pair(text: str) -> tuple[str, str]:
    layer, equals, where = text.partition("=")
    if not (layer and equals and where):
        raise argparse.ArgumentTypeError(f"LAYER=WHERE is wanted, as in depth=Z; got {text!r}")
    return layer, where


def guide_names(text: str) -> tuple[str, ...]:
    """`normal,depth,ao` as a tuple; an empty text is no guides."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def to_json(value: Any) -> str:
    """JSON text, with null for what JSON has no number for (NaN and infinities)."""
    return json.dumps(_finite(value), indent=2)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def table(rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """Rows of cells as aligned columns, the first `left` of them to the left."""
    rows = [[*map(printable, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )


def metrics_table(measured: Mapping[str, Mapping[str, float | None]]) -> str:
    """One row of metrics per image, `-` for one that could not be taken."""
    names = list(next(iter(measured.values())))
    rows = [["", *(LABELS[name] for name in names)]]
    for image, values in measured.items():
        rows.append([image, *("-" if values[n] is None else f"{values[n]:.4g}" for n in names)])
    return table(rows)


def profile_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Kernels as in the paper's table: time, bytes moved, share of what a copy kernel moves."""
    cells = [["kernel", "ms", "MB moved", "of copy bandwidth"]]
    cells += [
        [row["kernel"], f"{row['ms']:.2f}", f"{row['bytes'] / 1e6:.1f}", f"{row['share']:.0%}"]
        for row in rows
    ]
    return table(cells)
