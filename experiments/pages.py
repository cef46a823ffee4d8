"""Pages of what results/*.json say: tables and charts, and the figures within prose.

A figure in prose is a comment and the number after it, `<!--NAME:PART:ROW:COLUMN-->25.90`; it is
shown with as many decimals as it has. ROW: values that tell the row, with `;` between them; `A - B`
and `A / B` compare two rows.
"""

from __future__ import annotations

import hashlib
import json
import operator
import re
from pathlib import Path

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from experiments import results
from experiments.catalogue import NAMES, experiment
from experiments.plots import LABELS, write_text
from experiments.results import Parts, Row

FIGURE = re.compile(r"<!--([^:<>]+):([^:<>]+):([^:<>]+):([^:<>]+)-->(-?[\d.]*\d)")
LINK = re.compile(r"\(\.\./results/(\w+)\.json\)")
COMPARISONS = {" - ": operator.sub, " / ": operator.truediv}
CHANGED = "**The code has changed since.**"


def write(folder: Path, docs: Path) -> None:
    """Charts and tables into docs/figures from the JSON files in `folder`; figures in prose."""
    found = everything(folder)
    for name, evidence in found.items():
        draw(name, results.parts(evidence), docs / "figures")
    tables(found, docs / "figures")
    for path in prose(docs):
        text = path.read_text()
        if (current := filled(text, found)) != text:
            write_text(path, current)


def everything(folder: Path) -> dict[str, list[Row]]:
    """All results that are there, by name."""
    return {name: results.read(path) for name in NAMES if (path := _file(folder, name)).exists()}


def tables(found: dict[str, list[Row]], folder: Path) -> None:
    """A page for each experiment."""
    for name, evidence in found.items():
        text = page(name, evidence, (folder / f"{name}.png").exists())
        write_text(folder / f"{name}.md", text)


def prose(docs: Path) -> list[Path]:
    """The pages that are written by hand."""
    return [docs.parent / "README.md", *sorted(docs.glob("*.md"))]


def _file(folder: Path, name: str) -> Path:
    return folder / f"{name}.json"


def draw(name: str, parts: Parts, folder: Path) -> None:
    """The chart of an experiment, unless it is there already as drawn from the same figures."""
    path, digest = folder / f"{name}.png", digest_of(parts)
    charts = getattr(experiment(name), "charts", None)
    if charts is None or drawn_from(path) == digest:
        return
    folder.mkdir(exist_ok=True)
    charts(parts, folder)
    about = PngInfo()
    about.add_text("results", digest)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(128).save(path, pnginfo=about, optimize=True)


def drawn_from(path: Path) -> str | None:
    """The digest of the figures that a chart shows."""
    if not path.exists():
        return None
    with Image.open(path) as picture:
        return picture.info.get("results")


def digest_of(parts: Parts) -> str:
    """What tells these figures from others."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def page(name: str, evidence: list[Row], charted: bool) -> str:
    """All tables of an experiment, each with what it was measured by."""
    text = [f"# {experiment(name).QUESTION}", f"`python -m experiments run {name}`"]
    text += [f"![{name}]({name}.png)"] * charted
    for measured in evidence:
        for title, rows in measured["parts"].items():
            keys = dict.fromkeys(key for row in rows for key in row)
            table = results.table(rows, {key: LABELS.get(key, key) for key in keys})
            text += [f"## {title[0].upper()}{title[1:]}", f"*{_provenance(measured)}*", table]
    return "\n\n".join(text)


def _provenance(measured: Row) -> str:
    note = f" ({measured['note']})" if "note" in measured else ""
    mark = f" {CHANGED}" if results.changed(measured["commit"]) else ""
    return f"{results.provenance(measured)}{note}.{mark}"


def filled(text: str, found: dict[str, list[Row]]) -> str:
    """The text with every figure as the results have it. Raises ValueError for an unknown one."""

    def number(match: re.Match[str]) -> str:
        *key, old = match.groups()
        decimals = len(old.partition(".")[2])
        return f"<!--{':'.join(key)}-->{value(found, *key):.{decimals}f}"

    return FIGURE.sub(number, text)


def value(found: dict[str, list[Row]], name: str, part: str, row: str, column: str) -> float:
    """A figure of the results."""
    for sign, compare in COMPARISONS.items():
        if sign in row:
            return compare(*(value(found, name, part, one, column) for one in row.split(sign)))
    rows = results.parts(found.get(name, [])).get(part, [])
    words = row.split(";")
    mine = [r for r in rows if all(word in map(str, r.values()) for word in words)]
    if not mine or mine[0].get(column) is None:
        raise ValueError(f"the results have no figure {name}:{part}:{row}:{column}")
    return mine[0][column]


def noted(text: str, found: dict[str, list[Row]]) -> str:
    """A page of the site: results are linked as pages, and where figures are from is told."""
    names = dict.fromkeys(match[1] for match in FIGURE.finditer(text))
    notes = [
        f"- [{name}](figures/{name}.md): {', '.join(measured['parts'])}: {_provenance(measured)}"
        for name in names
        for measured in found[name]
    ]
    ending = "\n\n## Where the figures are from\n\n" + "\n".join(notes) if notes else ""
    return LINK.sub(r"(figures/\1.md)", text) + ending
