"""FLNR beside others, where it matters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from experiments import data
from experiments.methods import basic, oidn_peers, ours
from experiments.tune import quick_psnr
from jflnr import denoise
from jflnr.frame import Array, Frame
from jflnr.metrics import display, exposure

SHOWN = ("noisy", "OIDN, tuned", "flr-adaptive", "flnr", "reference")
SHADOWED = ("noisy", "OIDN, tuned", "flr", "flr-adaptive", "flnr", "reference")
CROP, SHADOW = 160, 80


def draw(folder: Path) -> None:
    """Crops of the frames that gain most and least over adaptive FLR; of each scene a square that
    the guides do not explain."""
    paths = data.frames("test")
    found = {path: data.read(path) for path in paths}
    psnr = lambda path, name: quick_psnr(found[path], denoise(found[path], name))
    by_gain = sorted(paths, key=lambda path: psnr(path, "flnr") - psnr(path, "flr-adaptive"))
    for path, name in ((by_gain[-1], "best"), (by_gain[0], "worst")):
        shown = _shown(found[path], SHOWN)
        change = np.sum((shown["flnr"] - shown["flr-adaptive"]) ** 2, axis=-1)
        _save(folder / f"flnr_{name}.png", [_strip(shown, change, CROP)])
    strips = [_shadow(data.read(path)) for path in data.one_view_each("test")]
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
    lights: dict[str, Array] = {
        m.name: m(frame) for m in [*basic(), *ours(), *oidn_peers()] if m.name in names
    }
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
