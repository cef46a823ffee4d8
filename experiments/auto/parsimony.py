"""Does method auto find the smallest model that is good enough?"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, resume
from experiments.methods import Method
from experiments.results import Parts, Row
from experiments.resume import ROOT
from experiments.timing import interleaved
from jflnr.auto.method import denoise_on_blocks, plan_of
from jflnr.auto.plan import BLOCKS
from jflnr.frame import Array, Frame
from jflnr.images.guides import layers
from jflnr.metrics import measure
from jflnr.regression.flr import DEFAULT, flr

NAME = "auto-parsimony"

# Of the times, whose best counts.
REPEATS = 5
# One view of one scene of every family, as `render data` makes them; they are training frames.
FAMILIES = "*-[1-4]_100.exr"
# BMFR's features of higher order (its Eq. 1), added to ours.
POWERS = {"squares of depth": "depth", "squares of normals": "normal", "squares of ao": "ao"}
FIXED = tuple(name for name in jflnr.METHODS if name not in ("auto", "bmfr"))


def run(quick: bool) -> Parts:
    """PSNR and time of every method on every frame, what auto chose, and BMFR's features."""
    paths = [data.SHIPPED] if quick else [*families(), *data.frames("val", "test")]
    keys = [str(path) for path in paths]
    tag = "-quick" * quick
    rows = resume.rows(f"{NAME}{tag}", keys, lambda key: one(Path(key), quick))
    tables = {"means": summary(rows), "by frame": [_flat(row) for row in rows]}
    return tables | {"squares of guides, dB": [powers(p) for p in paths if _is_shared(p)]}


def _flat(row: Row) -> Row:
    about = {"frame": row["frame"], "auto takes": row["form"], "guides": ", ".join(row["guides"])}
    return about | {"order": row["order"]} | {f"{n}, dB": v for n, v in row["psnr"].items()}


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
            | psnr
            | {"best of each frame": oracle, "best fixed": best}
            | {"auto loses, dB": psnr[best] - psnr["auto"]}
            | {"time of auto / best fixed": ms["auto"] / ms[best]}
            | {f"{form} / flr": ms[form] / ms["flr"] for form in ("auto", *BLOCKS)}
        )
    return found


def _split(row: dict[str, Any]) -> str:
    return row["frame"].split("/")[0]
