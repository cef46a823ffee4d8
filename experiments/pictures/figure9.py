"""Crops side by side with their metrics: the paper's Figure 9."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

import jflnr
from experiments import data, plots
from experiments.methods import basic, ours, peers
from jflnr.frame import Frame
from jflnr.metrics import compare, display, exposure

SIZE = 96
PEERS = ("guided filter, tuned", "SVGF, spatial, tuned", "BMFR, one frame, tuned", "OIDN, tuned")


def draw(folder: Path) -> None:
    """figure9.png: a crop of each test scene, where the methods' squared errors spread most.

    Of all windows of all its views, the noisy input left out; with metrics of the window at the
    exposure of the whole frame.
    """
    scenes: dict[str, list[Path]] = {}
    for path in data.frames("test"):
        scenes.setdefault(path.stem.rsplit("_", 1)[0], []).append(path)
    rows = []
    for views in scenes.values():
        found = [(path, *widest(path)) for path in views]
        path, corner, _ = max(found, key=lambda item: item[2])
        crop = {"frame": data.label(path), "corner": corner, "metrics": scores(path, corner)}
        _, shown = images_of(path)
        rows.append((crop, {n: image[window(corner)] for n, image in shown.items()}))
    plots.contact_sheet(folder / "figure9.png", rows)


@functools.lru_cache(maxsize=8)
def images_of(path: Path) -> tuple[Frame, dict[str, np.ndarray]]:
    """The frame, and the displayed picture by each method, with the reference last."""
    frame = data.read(path)
    albedo = np.asarray(frame.albedo, np.float64)
    assert frame.reference is not None
    reference = albedo * np.asarray(frame.reference)
    methods = [*basic()[:1], *(m for m in peers() if m.name in PEERS)]
    methods += [m for m in ours() if m.name in jflnr.METHODS]
    lights = {m.name: albedo * m(frame) for m in methods} | {"reference": reference}
    scale = exposure(reference)
    return frame, {name: display(light, scale) for name, light in lights.items()}


def widest(path: Path) -> tuple[tuple[int, int], float]:
    """Corner (row, column) of the window with the largest spread of errors, and that spread."""
    _, shown = images_of(path)
    reference = shown["reference"]
    errors = [
        uniform_filter(np.mean((shown[name] - reference) ** 2, axis=-1), SIZE)
        for name in shown
        if name not in ("noisy", "reference")
    ]
    half = SIZE // 2
    spread = np.ptp(errors, axis=0)[half:-half, half:-half]
    row, column = np.unravel_index(np.argmax(spread), spread.shape)
    return (int(row), int(column)), float(spread.max())


def scores(path: Path, corner: tuple[int, int]) -> Mapping[str, Mapping[str, float | None]]:
    """PSNR and FLIP of every method in the window."""
    _, shown = images_of(path)
    place = window(corner)
    # Displayed pictures are linear to the metrics once the gamma is taken off.
    linear = {name: image[place] ** 2.2 for name, image in shown.items()}
    found = {name: compare(image, linear["reference"]) for name, image in linear.items()}
    return {n: {"psnr": m["psnr"], "flip": m["flip"]} for n, m in found.items() if n != "reference"}


def window(corner: tuple[int, int]) -> tuple[slice, slice]:
    """The pixels of a crop."""
    return tuple(slice(start, start + SIZE) for start in corner)  # type: ignore[return-value]
