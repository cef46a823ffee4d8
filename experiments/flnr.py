"""FLNR beside everything else that can be run here, on the test frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from experiments import data, plots, results, resume
from experiments.methods import Method, basic, oidn_peers, ours
from experiments.table1 import PICTURE, mean_of, per_frame
from experiments.timing import times
from jflnr import denoise
from jflnr.frame import Array, Frame
from jflnr.metrics import display, exposure, measure

NAME = "flnr"
QUESTION = "What does the network add, frame by frame, and what does it cost?"
MINUTES = 2

COLUMNS = PICTURE | {"energy": "energy", "ms": "ms, 640 x 360"}
SHOWN = ("noisy", "OIDN, tuned", "flr-adaptive", "flnr", "reference")
SHADOWED = ("noisy", "OIDN, tuned", "flr", "flr-adaptive", "flnr", "reference")
CROP, SHADOW = 160, 80


def methods() -> list[Method]:
    """Noisy, FLR with and without ambient occlusion, ours, OIDN."""
    without = {"guides": ("normal", "depth")}
    mine = [method for method in ours() if method.on_device]
    noisy = [method for method in basic() if method.name == "noisy"]
    return [*noisy, Method("flr, no ao", "jflnr", denoise, without), *mine, *oidn_peers()]


def run(quick: bool) -> dict[str, Any]:
    """Metrics of each method on each test frame, their means, and times."""
    all_methods = methods()
    paths = [data.SHIPPED] if quick else data.frames("test")

    def on_frame(path: str) -> list[dict[str, Any]]:
        frame, label = data.read(Path(path)), data.label(Path(path))
        return [{"method": m.name, "frame": label} | _measured(frame, m) for m in all_methods]

    found = resume.rows(f"{NAME}{'-quick' * quick}", [str(path) for path in paths], on_frame)
    frames = [row for rows in found for row in rows]
    clock = times([m for m in all_methods if m.name != "noisy"], data.read(paths[0]), quick)
    means = [mean_of(frames, m.name) for m in all_methods]
    for row in means:
        mine = [other["energy"] for other in frames if other["method"] == row["method"]]
        row["energy"] = f"{min(mine):.3f} to {max(mine):.3f}"
        if row["method"] in clock:
            row["ms"] = clock[row["method"]]
    return {"means": means, "frames": frames}


def _measured(frame: Frame, method: Method) -> dict[str, Any]:
    """Metrics, and the radiance of the result relative to the input's."""
    light, albedo = method(frame), np.asarray(frame.albedo, np.float64)
    energy = np.sum(albedo * light) / np.sum(albedo * np.asarray(frame.indirect))
    return measure(frame, light) | {"energy": float(energy)}


def draw(result: dict[str, Any], folder: Path) -> None:
    """flnr_table.md; crops of the frames that gain most and least over adaptive FLR, the whole of
    the worst, and a square of each scene that the guides do not explain."""
    text = results.table(result["means"], COLUMNS) + "\n" + per_frame(result["frames"])
    plots.write_text(folder / "flnr_table.md", text)
    psnr = {(row["method"], row["frame"]): row["psnr"] for row in result["frames"]}
    labels = {row["frame"] for row in result["frames"]}
    by_gain = sorted(labels, key=lambda f: psnr["flnr", f] - psnr["flr-adaptive", f])
    paths = {data.label(p): p for p in [data.SHIPPED, *data.frames("test")]}
    for label, name in ((by_gain[-1], "best"), (by_gain[0], "worst")):
        shown = _shown(data.read(paths[label]), SHOWN)
        change = np.sum((shown["flnr"] - shown["flr-adaptive"]) ** 2, axis=-1)
        _save(folder / f"flnr_{name}.png", [_strip(shown, change, CROP)])
    lowest = data.read(paths[min(labels, key=lambda label: psnr["flnr", label])])
    whole = _shown(lowest, ("flnr", "reference"))
    whole["difference"] = np.abs(whole["flnr"] - whole["reference"])
    _save(folder / "flnr_lowest.jpg", [np.concatenate(list(whole.values()), axis=1)], times=1)
    one_each = {label.rsplit("_", 1)[0]: label for label in sorted(labels, reverse=True)}
    strips = [_shadow(data.read(paths[label])) for label in one_each.values()]
    _save(folder / "flnr_shadows.png", strips)


def _shadow(frame: Frame) -> np.ndarray:
    """Side by side, the part of the frame whose light the guides explain least.

    There even plain FLR of the reference itself is far from the reference.
    """
    shown = _shown(frame, SHADOWED)
    explained = _display(frame, denoise(replace(frame, indirect=_reference(frame)), "flr"))
    return _strip(shown, np.sum((explained - shown["reference"]) ** 2, axis=-1), SHADOW)


def _shown(frame: Frame, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Displayed pictures by name of the method."""
    lights: dict[str, Array] = {m.name: m(frame) for m in methods() if m.name in names}
    lights["reference"] = _reference(frame)
    return {name: _display(frame, lights[name]) for name in names if name in lights}


def _display(frame: Frame, light: Array) -> np.ndarray:
    albedo = np.asarray(frame.albedo, np.float64)
    return display(albedo * np.asarray(light), exposure(albedo * _reference(frame)))


def _reference(frame: Frame) -> np.ndarray:
    return np.asarray(frame.reference)


def _strip(shown: dict[str, np.ndarray], change: np.ndarray, side: int) -> np.ndarray:
    """Side by side, the square of all pictures in which most has changed."""
    rows, columns = (size // side for size in change.shape)
    blocks = change[: rows * side, : columns * side].reshape(rows, side, columns, side)
    y, x = np.unravel_index(np.argmax(blocks.sum((1, 3))), (rows, columns))
    part = np.s_[y * side : (y + 1) * side, x * side : (x + 1) * side]
    return np.concatenate([picture[part] for picture in shown.values()], axis=1)


def _save(path: Path, strips: list[np.ndarray], times: int = 2) -> None:
    """One strip below the other, so many times as large."""
    picture = np.concatenate(strips).repeat(times, 0).repeat(times, 1)
    Image.fromarray((255 * picture + 0.5).astype(np.uint8)).save(path)
