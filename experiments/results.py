"""Evidence: what an experiment measured, kept as `results/NAME.json`.

Such a file is a list of measurements, each with where and by which code it was made and its tables:
`{"commit", "date", "device", ..., "parts": {title: [row, ...]}}`. All else is made from these.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

import jax

from experiments import resume
from jflnr.files import write_atomically

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "results"
PACKAGES = ("jax", "jaxopt", "numpy", "pyopencl", "pocl-binary-distribution", "pyoidn", "mitsuba")
# What figures depend on, of the package.
CODE = ("jflnr/*.py", "jflnr/*.npz", "kernels_cl")

Row = dict[str, Any]
Parts = dict[str, list[Row]]


class Experiment(Protocol):
    """What a module of this folder offers, or an entry of `sweeps.TABLE`.

    Some offer `charts(parts, folder)` too, which draws `NAME.png`.
    """

    @property
    def NAME(self) -> str: ...
    @property
    def QUESTION(self) -> str: ...
    @property
    def MINUTES(self) -> int:
        """What a whole run takes on two cores."""

    def run(self, quick: bool) -> Parts:
        """The figures: tables by title, rows of JSON values."""


def run(experiment: Experiment, quick: bool, folder: Path) -> None:
    """Run one experiment and write `FOLDER/NAME.json`."""
    long = "under a minute" if quick else f"about {experiment.MINUTES} min on two cores"
    print(f"{experiment.NAME}: {experiment.QUESTION} ({long})", flush=True)
    measured: Row = environment() | ({"quick": True} if quick else {})
    start = time.perf_counter()
    parts = experiment.run(quick)
    measured["minutes"] = round((time.perf_counter() - start) / 60, 1)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{experiment.NAME}.json"
    write(path, [measured | {"parts": parts}])
    resume.forget(experiment.NAME)
    print(f"{experiment.NAME}: wrote {path}")


def write(path: Path, evidence: list[Row]) -> None:
    """One row a line, figures to four digits, so that a change shows."""
    text = json.dumps([_rounded(measured) for measured in evidence], indent=1)
    found = json.loads(text)
    lines = []
    for measured in found:
        parts = [
            f"{json.dumps(title)}: [\n" + ",\n".join(map(json.dumps, rows)) + "\n]"
            for title, rows in measured.pop("parts").items()
        ]
        head = json.dumps(measured, indent=1)[1:-1].rstrip()
        lines.append("{" + head + ',\n"parts": {\n' + ",\n".join(parts) + "\n}}")
    write_atomically(path, ("[" + ",\n".join(lines) + "]\n").encode())


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value


def read(path: Path) -> list[Row]:
    """The measurements in a file."""
    return json.loads(path.read_bytes())


def parts(evidence: list[Row]) -> Parts:
    """The tables of all measurements."""
    return {title: rows for measured in evidence for title, rows in measured["parts"].items()}


def provenance(measured: Row) -> str:
    """Of which code and on what the figures are."""
    known = [f"{name} {number}" for name, number in measured.get("versions", {}).items()]
    about = [f"commit {measured['commit']}", measured["date"], measured["device"]]
    return ", ".join([*about, *known])


def changed(commit: str) -> bool:
    """Whether the code that figures depend on has changed since a commit, or nobody knows."""
    command = ["git", "diff", "--quiet", commit.removesuffix("-dirty"), "--", *CODE]
    return subprocess.run(command, cwd=ROOT, capture_output=True, check=False).returncode != 0


def environment() -> Row:
    """Where and with what the figures are made."""
    return {
        "commit": _commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "device": _device(),
        "command": " ".join(["python -m experiments", *sys.argv[1:]]),
        "versions": {
            "python": platform.python_version(),
            **{name: found for name in PACKAGES if (found := _version(name))},
        },
    }


def table(rows: list[Row], columns: dict[str, str]) -> str:
    """A Markdown table; `columns` maps keys of the rows to headings."""
    lines = ["| " + " | ".join(columns.values()) + " |", "|" + " --- |" * len(columns)]
    for row in rows:
        lines.append("| " + " | ".join(_cell(row.get(key)) for key in columns) + " |")
    return "\n".join(lines) + "\n"


def pivoted(rows: list[Row], down: str, across: str, value: str) -> list[Row]:
    """Rows by `down`, with a column for every value of `across`."""
    found: dict[Any, Row] = {}
    for row in rows:
        if row.get(value) is not None:
            found.setdefault(row[down], {down: row[down]})[str(row[across])] = row[value]
    return list(found.values())


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def _commit() -> str:
    try:
        text = subprocess.run(
            ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return text.stdout.strip()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _device() -> str:
    if jax.default_backend() != "cpu":
        return str(jax.devices()[0].device_kind)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {_processor()}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "unknown")
