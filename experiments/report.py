"""One HTML page of all results on disk: pictures to compare, the speed chart, every table."""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data
from experiments.methods import Method, ours, peers
from jflnr import exr
from jflnr.cli.common import LABELS
from jflnr.report.page import write_report
from jflnr.report.scenes import Scene, of_frame

FILE = "report.html"
SHOWN = (*jflnr.METHODS, "OIDN, tuned")


def write(out: Path, names: Sequence[str]) -> None:
    """Write `OUT/report.html` from the JSON files in `out` of the experiments `names`."""
    out.mkdir(parents=True, exist_ok=True)
    found = {name: out / f"{name}.json" for name in names if (out / f"{name}.json").exists()}
    evidence = {name: json.loads(path.read_bytes()) for name, path in found.items()}
    tables = [table for name in evidence for table in tables_of(name, evidence[name])]
    write_report(out / FILE, scenes(out), "jflnr: results", tables, chart(evidence))
    print(f"report: wrote {out / FILE}")


def scenes(out: Path) -> list[Scene]:
    """One view of each test scene by each of `SHOWN`; `OUT/pictures` keeps what was denoised."""
    methods = [method for method in [*ours(), *peers()] if method.name in SHOWN]
    made = []
    for path in data.one_view_each("test"):
        frame = data.read(path)
        folder = out / "pictures" / path.stem
        lights = {method.name: _light(method, frame, folder) for method in methods}
        made.append(of_frame(path.stem, frame, lights))
    return made


def _light(method: Method, frame: Any, folder: Path) -> np.ndarray:
    path = folder / f"{method.name}.exr"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        light = np.asarray(method(frame), np.float32)
        exr.write_channels(path, {f"indirect.{c}": light[..., i] for i, c in enumerate("RGB")})
    channels = exr.read_channels(path)
    return np.stack([channels[f"indirect.{c}"] for c in "RGB"], axis=-1)


def chart(evidence: dict[str, Any]) -> dict[str, Any] | None:
    """Accuracy against time: table 1's methods in all metrics, else every setting of `pareto`."""
    from experiments.table1 import family

    if "table1" in evidence:
        rows = [row for row in evidence["table1"]["result"]["means"] if "ms" in row]
        rows = [row | {"family": family(row["method"])} for row in rows]
    elif "pareto" in evidence:
        rows = evidence["pareto"]["result"]["rows"]
    else:
        return None
    return {"title": "Speed and accuracy, one sample per pixel", "x": "ms", "rows": rows}


def tables_of(name: str, evidence: dict[str, Any]) -> list[dict[str, Any]]:
    """Every list of records in one experiment's results, as a table of its plain values."""
    environment = evidence["environment"]
    note = (
        f"{importlib.import_module(f'experiments.{name}').QUESTION} {environment['command']}, "
        f"{environment['time']}, {environment['processor']}, {environment['commit']}"
    )
    tables = []
    for part, rows in evidence["result"].items():
        if isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows):
            keys = dict.fromkeys(key for row in rows for key, v in row.items() if plain(v))
            columns = {key: LABELS.get(key, key.replace("_", " ")) for key in keys}
            tables.append({"title": f"{name}: {part}", "note": note, "columns": columns})
            tables[-1]["rows"] = [{key: row.get(key) for key in keys} for row in rows]
    return tables


def plain(value: object) -> bool:
    """Whether a table can show it."""
    return isinstance(value, str | int | float)
