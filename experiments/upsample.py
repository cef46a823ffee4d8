"""Joint denoising and upsampling (section 3.2.1): fewer pixels with more samples each."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, results, resume
from experiments.methods import Method
from experiments.timing import times
from experiments.tune import quick_psnr
from jflnr.frame import Frame
from jflnr.guides import shrink

NAME = "upsample"
QUESTION = "For the same rays, is light traced at 1/2 or 1/4 resolution as good?"
MINUTES = 1

FACTORS = (1, 2, 4)


def run(quick: bool) -> dict[str, Any]:
    """Mean PSNR over the test frames at 1/1, 1/2, 1/4 resolution, and milliseconds.

    A pixel of the smaller image is the mean of the samples over its area: f^2 times as many
    samples per pixel, and as many rays.
    """
    budgets, factors = ((1,), FACTORS[:2]) if quick else ((1, 4, 16), FACTORS)
    paths = [data.SHIPPED] if quick else data.frames("test")
    keys = [f"{spp} {factor}" for spp in budgets for factor in factors]

    def accuracy(key: str) -> list[float]:
        spp, factor = map(int, key.split())
        found = []
        for path in paths:
            frame = data.read(path, spp)
            found.append(quick_psnr(frame, jflnr.denoise(traced_at(frame, factor))))
        return found

    values = resume.rows(f"{NAME}{'-quick' * quick}", keys, accuracy)
    methods = [
        Method(str(f), "jflnr", jflnr.denoise, {}, True, functools.partial(traced_at, factor=f))
        for f in factors
    ]
    clock = times(methods, data.read(paths[0]), quick)
    rows = []
    for key, found in zip(keys, values, strict=True):
        spp, factor = key.split()
        row = {"rays": int(spp), "factor": int(factor), "spp": int(spp) * int(factor) ** 2}
        rows.append(row | {"psnr": float(np.mean(found))} | {"ms": clock[factor]})
    return {"rows": rows}


def traced_at(frame: Frame, factor: int) -> Frame:
    """The frame with its noisy light at 1/factor of the resolution."""
    if factor == 1:
        return frame
    light = jnp.asarray(frame.indirect)
    mask = None if frame.mask is None else jnp.asarray(frame.mask)
    return dataclasses.replace(frame, indirect=np.asarray(shrink(light, factor, mask)))


def draw(result: dict[str, Any], folder: Path) -> None:
    """upsample.png: PSNR against the rays spent; upsample.md."""
    columns = {
        "rays": "samples per full-size pixel",
        "factor": "resolution, 1/",
        "spp": "spp there",
    }
    columns |= {"psnr": "PSNR, dB", "ms": "ms, 640 x 360"}
    plots.write_text(folder / f"{NAME}.md", results.table(result["rows"], columns))
    budgets = sorted({row["rays"] for row in result["rows"]})
    with plots.figure(folder / f"{NAME}.png") as axis:
        for factor, style in zip(FACTORS, ("o-", "s--", "^:"), strict=True):
            mine = [row for row in result["rows"] if row["factor"] == factor]
            name = "full resolution" if factor == 1 else f"1/{factor} resolution"
            axis.plot([r["rays"] for r in mine], [r["psnr"] for r in mine], style, label=name)
        axis.set(xscale="log", xlabel="samples per full-size pixel", ylabel="PSNR, dB")
        axis.set_xticks(budgets, map(str, budgets))
        axis.minorticks_off()
        axis.legend()
