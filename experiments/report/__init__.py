"""One HTML page of all results: pictures to compare, the chart of speed and accuracy, all tables.

The chart is drawn by Chart.js (MIT, `chart.LICENSE.md`).
"""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, results
from experiments.methods import Method, family, ours, peers
from jflnr import exr
from jflnr.metrics import LABELS
from jflnr.report.page import script_data, write_report
from jflnr.report.scenes import Scene, of_frame

FILE = "report.html"
SHOWN = (*jflnr.METHODS, "OIDN, tuned")


def write(folder: Path, out: Path) -> None:
    """Write `OUT/report.html` from the JSON files in `folder`."""
    out.mkdir(parents=True, exist_ok=True)
    found = {path.stem: results.read(path) for path in sorted(folder.glob("*.json"))}
    tables = [table for name in found for table in tables_of(name, found[name])]
    rows = results.parts(found["methods"])["means"] if "methods" in found else []
    extra = chart("Speed and accuracy, one sample per pixel", rows)
    write_report(out / FILE, scenes(out), "jflnr: results", tables, extra)
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


def chart(title: str, rows: list[dict[str, Any]]) -> str:
    """HTML that draws the rows that have `ms` against any metric; nothing without such rows."""
    timed = [row | {"family": family(row["method"])} for row in rows if "ms" in row]
    if not timed:
        return ""
    folder = files("experiments.report")
    read = lambda name: (folder / name).read_text(encoding="utf-8")
    parts = {"TITLE": title, "LIBRARY": read("chart.umd.min.js"), "SCRIPT": read("chart.js")}
    parts["DATA"] = script_data({"x": "ms", "rows": timed})
    return re.sub("%%([A-Z]+)%%", lambda mark: parts[mark[1]], read("chart.html"))


def tables_of(name: str, evidence: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Every table of one experiment's results."""
    tables = []
    for measured in evidence:
        note = f"{name}: {results.provenance(measured)}"
        for title, rows in measured["parts"].items():
            keys = dict.fromkeys(key for row in rows for key in row)
            columns = {key: LABELS.get(key, key.replace("_", " ")) for key in keys}
            found = [{key: row.get(key) for key in keys} for row in rows]
            about = {"title": f"{name}: {title}", "note": note, "columns": columns}
            tables.append(about | {"rows": found})
    return tables
