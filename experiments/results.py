"""Running an experiment so that it leaves evidence: a JSON file, and charts drawn from it."""

from __future__ import annotations

import json
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

PACKAGES = ("jax", "jaxopt", "numpy", "pyopencl", "pocl-binary-distribution", "pyoidn", "mitsuba")


class Experiment(Protocol):
    """What a module of this folder offers."""

    NAME: str
    QUESTION: str
    MINUTES: int  # that a whole run takes on two cores

    def run(self, quick: bool) -> dict[str, Any]:
        """The figures, as JSON values."""

    def draw(self, result: dict[str, Any], folder: Path) -> None:
        """Charts and Markdown tables from what `run` returned."""


def run(experiment: Experiment, quick: bool, out: Path) -> None:
    """Run one experiment and write `OUT/NAME.json`."""
    long = "under a minute" if quick else f"about {experiment.MINUTES} min on two cores"
    print(f"{experiment.NAME}: {experiment.QUESTION} ({long})", flush=True)
    evidence: dict[str, Any] = {"environment": environment(), "quick": quick}
    start = time.perf_counter()
    evidence["result"] = experiment.run(quick)
    evidence["environment"]["minutes"] = round((time.perf_counter() - start) / 60, 1)
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{experiment.NAME}.json"
    write_atomically(path, (json.dumps(evidence, indent=1) + "\n").encode())
    resume.forget(experiment.NAME)
    print(f"{experiment.NAME}: wrote {path}")


def draw(experiment: Experiment, out: Path, docs: Path | None) -> None:
    """Draw the charts and tables of one experiment from its JSON."""
    folder = docs or out
    folder.mkdir(parents=True, exist_ok=True)
    evidence = json.loads((out / f"{experiment.NAME}.json").read_bytes())
    experiment.draw(evidence["result"], folder)


def environment() -> dict[str, Any]:
    """Where and with what the figures were made."""
    return {
        "commit": _commit(),
        "command": " ".join(["python -m experiments", *sys.argv[1:]]),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": _processor(),
        "cores": len(jax.devices()) if jax.default_backend() != "cpu" else _cores(),
        "device": str(jax.devices()[0].device_kind),
        "python": platform.python_version(),
        "versions": {name: found for name in PACKAGES if (found := _version(name))},
    }


def table(rows: list[dict[str, Any]], columns: dict[str, str]) -> str:
    """A Markdown table; `columns` maps keys of the rows to headings."""
    lines = ["| " + " | ".join(columns.values()) + " |", "|" + " --- |" * len(columns)]
    for row in rows:
        lines.append("| " + " | ".join(_cell(row.get(key, "")) for key in columns) + " |")
    return "\n".join(lines) + "\n"


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


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


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "unknown")


def _cores() -> int:
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
