"""Whole pictures of Cycles by what their pixels show, and by how noisy their guides are."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

import jflnr
from experiments import plots
from experiments.peers import oidn
from experiments.results import Parts, Row
from experiments.whole import (
    SAMPLES,
    auxiliaries,
    decibels,
    folders,
    images,
    references,
    shown,
    squares,
)
from jflnr.frame import Array, Frame
from jflnr.metrics import exposure

NAME = "materials"
QUESTION = "Which materials come out well, and how good must the guides of a whole picture be?"
MINUTES = 3

# Samples per pixel of the picture; those of the picture that tells the materials.
SPP, TELLING = 4, 16
NAMES = {"noisy": "noisy", "ours": "picture", "flnr": "flnr-picture", "clean": "OIDN, prefiltered"}
KINDS = "diffuse", "glossy, metal", "glass", "lamps, sky"
# Share of a pixel's light above which it shows lamps or sky.
SHINING = 0.5
GUIDES = ("seen_albedo", "normal", "seen_normal", "emitted", "environment", "samples")
BY_KIND, BY_GUIDES = "by what a pixel shows", "by samples of the guides"


def run(quick: bool) -> Parts:
    """PSNR without the references' noise, over all pictures."""
    some = folders()[: 1 if quick else None]
    return {BY_KIND: by_kind(some), BY_GUIDES: by_guides(some)}


def by_kind(pictures: list[Path]) -> list[Row]:
    """Of the pixels that show mostly one kind of material, and how many these are."""
    found: dict[str, dict[str, list[np.ndarray]]] = {kind: {} for kind in KINDS}
    pixels = 0
    for folder in pictures:
        halves = references(folder / "reference.exr")
        scale = exposure((halves[0] + halves[1]) / 2)
        shows = kinds(jflnr.read_frame(folder / f"{TELLING}spp.exr"))
        pixels += shows.size
        for method, image in images(read(folder, SPP)).items():
            error = squares(*shown(scale, image, *halves))
            for number, kind in enumerate(KINDS):
                found[kind].setdefault(method, []).append(error[shows == number])
    rows = []
    for kind, errors in found.items():
        joined = {method: np.concatenate(some) for method, some in errors.items()}
        row: Row = {"pixel": kind, "share": len(joined["noisy"]) / pixels}
        rows.append(row | {NAMES[m]: decibels(e) for m, e in joined.items() if m in NAMES})
    return rows


def kinds(frame: Frame) -> np.ndarray:
    """Which of KINDS a pixel mostly shows, `(H, W)`."""
    colours = np.asarray(frame.lobe_colours)
    surfaces = colours.reshape(*colours.shape[:2], -1, 3).mean(-1)[..., :3]
    own = np.asarray(frame.emitted) + np.asarray(frame.environment)
    shines = own.mean(-1) > SHINING * np.asarray(frame.beauty).mean(-1)
    return np.where(shines, len(KINDS) - 1, np.argmax(surfaces, axis=-1))


def by_guides(pictures: list[Path]) -> list[Row]:
    """Mean over the pictures that there are at all counts, with the guides of each count."""
    whole = [p for p in pictures if all((p / f"{spp}spp.exr").exists() for spp in SAMPLES)]
    rows = []
    for spp in SAMPLES if whole else ():
        found: dict[str, list[float]] = {}
        for folder in whole:
            halves = references(folder / "reference.exr")
            scale = exposure((halves[0] + halves[1]) / 2)
            for method, image in guided(folder, spp).items():
                error = squares(*shown(scale, image, *halves))
                found.setdefault(method, []).append(decibels(error))
        rows += [{"guides": spp, "method": m, "psnr": float(np.mean(x))} for m, x in found.items()]
    return rows


def guided(folder: Path, spp: int) -> dict[str, Array]:
    """A noisy picture denoised with the guides of another that has so many samples per pixel."""
    frame, others = read(folder, SPP), read(folder, spp).layers()
    frame = dataclasses.replace(frame, **{n: others[n] for n in GUIDES if n in others})
    return {
        "picture": jflnr.denoise(frame, "picture")[..., :3],
        "OIDN": oidn.layers(color=frame.beauty, **auxiliaries(frame)),
        "OIDN, prefiltered": oidn.prefiltered(frame.beauty, **auxiliaries(frame)),
    }


def read(folder: Path, spp: int) -> Frame:
    """The picture of so many samples per pixel."""
    return jflnr.read_frame(folder / f"{spp}spp.exr")


def charts(parts: Parts, folder: Path) -> None:
    """materials.png: PSNR by what a pixel shows, and by samples of the guides."""
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        rows, names = parts[BY_KIND], list(NAMES.values())
        for number, name in enumerate(names):
            place = np.arange(len(rows)) + 0.8 * (number / len(names) - 0.5)
            left.bar(place, [row[name] for row in rows], 0.2, align="edge", label=name)
        left.set_xticks(np.arange(len(rows)), [f"{r['pixel']}\n{r['share']:.0%}" for r in rows])
        left.set(ylabel="PSNR, dB", ylim=(10, 38))
        left.legend(fontsize=8)
        rows = parts[BY_GUIDES]
        for mark, name in zip("osD", dict.fromkeys(row["method"] for row in rows), strict=False):
            mine = [(row["guides"], row["psnr"]) for row in rows if row["method"] == name]
            right.plot(*np.transpose(mine), f"{mark}-", label=name)
        right.set(xscale="log", xlabel="samples per pixel of the guides", ylabel="PSNR, dB")
        right.set_xticks(SAMPLES, map(str, SAMPLES))
        right.minorticks_off()
        right.legend(fontsize=8)
