"""Does method auto find the smallest model that is good enough?"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, results, resume
from experiments.methods import Method
from experiments.resume import ROOT
from experiments.speed import interleaved
from jflnr.regression.parameters import DEFAULT
from jflnr.regression.flr import flr
from jflnr.frame import Array, Frame
from jflnr.guides import layers
from jflnr.metrics import measure
from jflnr.auto.method import denoise_on_blocks, plan_of
from jflnr.auto.plan import BLOCKS

NAME = "parsimony"
QUESTION = "Does method auto find the smallest model that is good enough, and what does it save?"
MINUTES = 8

# Of the times, whose best counts.
REPEATS = 5
# One view of one scene of every family, as `render data` makes them; they are training frames.
FAMILIES = "*-[1-4]_100.exr"
# BMFR's features of higher order (its Eq. 1), added to ours.
POWERS = {"squares of depth": "depth", "squares of normals": "normal", "squares of ao": "ao"}
FIXED = tuple(name for name in jflnr.METHODS if name not in ("auto", "bmfr"))
MARKERS = {"train": "o", "val": "s", "test": "^", "simple": "D"}


def run(quick: bool) -> dict[str, Any]:
    """PSNR and time of every method on every frame, what auto chose, and BMFR's features."""
    paths = [data.SHIPPED] if quick else [*families(), *data.frames("val", "test")]
    keys = [str(path) for path in paths]
    tag = "-quick" * quick
    rows = resume.rows(f"{NAME}{tag}", keys, lambda key: one(Path(key), quick))
    return {"rows": rows, "powers": [powers(path) for path in paths if _is_shared(path)]}


def families() -> list[Path]:
    """The simple scenes of JFLNR_SIMPLE, and the first scene of every family that is rendered."""
    simple = sorted(
        Path(os.environ.get("JFLNR_SIMPLE", ROOT / "cache/frames/simple")).glob("*.exr")
    )
    found: dict[str, Path] = {}
    for path in sorted((ROOT / "cache" / "frames" / "train").glob(FAMILIES)):
        found.setdefault(path.stem.split("-")[0], path)
    return [*simple, *found.values()]


def _is_shared(path: Path) -> bool:
    return path.parent.name in ("val", "test")


def methods() -> list[Method]:
    """Every method of jflnr for single frames, and the forms of auto by themselves."""
    names = [name for name in jflnr.METHODS if name != "bmfr"]
    found = [Method(name, "jflnr", jflnr.denoise, {"method": name}) for name in names]
    return [*found, *(Method(form, "jflnr", on_blocks, {"form": form}) for form in BLOCKS)]


def on_blocks(frame: Frame, form: str) -> Array:
    """One form of method auto by itself."""
    return denoise_on_blocks(frame, form)[0]


def tiled(frame: Frame, height: int = 1080, width: int = 1920) -> Frame:
    """The frame beside and below itself, up to the size of a screen: for times only."""

    def tile(layer: Array) -> np.ndarray:
        h, w = layer.shape[:2]
        return np.tile(layer, (-(-height // h), -(-width // w), 1))[:height, :width]

    return jax.tree.map(tile, frame)


def one(path: Path, quick: bool) -> dict[str, Any]:
    """PSNR of all methods on one frame, and milliseconds at 1920 x 1080."""
    frame = jflnr.read_frame(path)
    plan = plan_of(frame)
    large = frame if quick else tiled(frame)
    calls = {method.name: method.prepare(large) for method in methods()}
    seconds = interleaved(calls, 1 if quick else REPEATS)
    psnr = {method.name: measure(frame, method(frame))["psnr"] for method in methods()}
    return {
        "frame": data.label(path),
        "form": plan.form,
        "guides": list(plan.guides),
        "predicted": dict(plan.decibels),
        "order": float(np.mean(plan.order)),
        "psnr": psnr,
        "ms": {name: 1e3 * t for name, t in seconds.items()},
    }


def powers(path: Path) -> dict[str, Any]:
    """What each feature of second order brings plain FLR, in dB."""
    frame = jflnr.read_frame(path)
    row: dict[str, Any] = {"frame": data.label(path), "flr": _with_squares(frame, None)}
    return row | {name: _with_squares(frame, of) - row["flr"] for name, of in POWERS.items()}


def _with_squares(frame: Frame, name: str | None) -> float:
    added = () if name is None else (layers(frame, (name,))[0] ** 2,)
    guides = (*layers(frame, ("normal", "depth", "ao")), *added)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0]
    image = _flr(jnp.asarray(frame.indirect), guides, DEFAULT, weight=weight)
    return float(measure(frame, image)["psnr"] or 0)


_flr = jax.jit(flr)


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Means by split: PSNR and time of every method, and auto's against the best fixed one."""
    found = []
    for split in dict.fromkeys(_split(row) for row in rows):
        mine = [row for row in rows if _split(row) == split]
        names = list(mine[0]["psnr"])
        psnr = {n: float(np.mean([row["psnr"][n] for row in mine])) for n in names}
        ms = {n: float(np.mean([row["ms"][n] for row in mine])) for n in names}
        fixed = [n for n in names if n in FIXED]
        best = max(fixed, key=lambda n: psnr[n])
        oracle = float(np.mean([max(row["psnr"][n] for n in fixed) for row in mine]))
        found.append(
            {"split": split, "frames": len(mine)}
            | {f"{n} dB": psnr[n] for n in names}
            | {"oracle dB": oracle, "best": best, "loss": psnr[best] - psnr["auto"]}
            | {"time": ms["auto"] / ms[best], "per_flr": ms["auto"] / ms["flr"]}
            | {f"{form} ms": ms[form] / ms["flr"] for form in BLOCKS}
        )
    return found


def _split(row: dict[str, Any]) -> str:
    return row["frame"].split("/")[0]


def draw(result: dict[str, Any], folder: Path) -> None:
    """parsimony.md: means, every frame, BMFR's features; parsimony.png: regret against saving."""
    rows = result["rows"]
    names = list(rows[0]["psnr"])
    columns = {"split": "split", "frames": "frames"} | {f"{n} dB": n for n in names}
    columns |= {"oracle dB": "best of each frame", "best": "best fixed", "loss": "auto loses, dB"}
    columns |= {"time": "time of auto / best fixed", "per_flr": "auto / flr"}
    columns |= {f"{form} ms": f"{form} / flr" for form in BLOCKS}
    tables = [results.table(summary(rows), columns)]
    each = [{**row, **row["psnr"], "kept": ", ".join(row["guides"])} for row in rows]
    tables.append(
        results.table(
            each,
            {"frame": "frame", "form": "auto takes", "kept": "guides", "order": "order"}
            | {n: f"{n}, dB" for n in names},
        )
    )
    if result["powers"]:
        tables.append(results.table(result["powers"], {k: k for k in result["powers"][0]}))
    plots.write_text(folder / f"{NAME}.md", "\n".join(tables))
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        _regret(left, rows)
        _frontier(right, rows)


def _regret(axis: Any, rows: list[dict[str, Any]]) -> None:
    for split, marker in MARKERS.items():
        mine = [row for row in rows if _split(row) == split]
        fixed = [max(FIXED, key=row["psnr"].get) for row in mine]
        saved = [1 - r["ms"]["auto"] / r["ms"][n] for r, n in zip(mine, fixed, strict=True)]
        lost = [r["psnr"][n] - r["psnr"]["auto"] for r, n in zip(mine, fixed, strict=True)]
        if mine:
            axis.plot(saved, lost, marker, label=split)
    axis.axhline(0.1, color="grey", linewidth=1)
    axis.set(xlabel="time saved against the frame's best method", ylabel="PSNR lost to it, dB")
    axis.legend()


def _frontier(axis: Any, rows: list[dict[str, Any]]) -> None:
    mine = [row for row in rows if _split(row) == "test"] or rows
    for name, marker in zip(mine[0]["psnr"], "osv^D*<>P", strict=True):
        x = float(np.mean([row["ms"][name] / row["ms"]["flr"] for row in mine]))
        y = float(np.mean([row["psnr"][name] for row in mine]))
        axis.plot([x], [y], marker, label=name, markersize=11 if name == "auto" else 7, alpha=0.8)
    axis.set(xlabel="time, in that of plain FLR", ylabel="PSNR, dB, mean of test", xlim=(0, None))
    axis.legend(fontsize=8, loc="lower right")
