"""Light groups: several targets in one solve, against one run for each."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, plots, results
from experiments.methods import Method, backends
from experiments.timing import times
from jflnr.frame import Frame

NAME = "lightgroups"
QUESTION = "What do further light groups cost, and do they still sum to the whole?"
MINUTES = 1

# Of the OpenCL kernels: 9 channels.
MOST = {"jax": 8, "opencl": 3}


def run(quick: bool) -> dict[str, Any]:
    """Milliseconds at 640 x 360 together and one by one; the error of the sum."""
    frame = data.read(data.SHIPPED if quick else data.frames("test")[0])
    counts = (1, 2) if quick else (1, 2, 3, 4, 5, 6, 8)
    methods = [
        Method(
            f"{backend} {count}",
            "jflnr",
            jflnr.denoise,
            {"backend": backend},
            backend == "jax",
            functools.partial(grouped, count=count),
        )
        for backend in backends()
        for count in counts
        if count <= MOST[backend]
    ]
    clock = times(methods, frame, quick)
    rows = []
    for method in methods:
        backend, count = method.name.split()
        rows.append(
            {
                "backend": backend,
                "groups": int(count),
                "ms": clock[method.name],
                "separate_ms": int(count) * clock[f"{backend} 1"],
                "error": error_of_sum(frame, int(count), backend),
            }
        )
    return {"rows": rows}


def grouped(frame: Frame, count: int) -> Frame:
    """The light split at random, pixel by pixel, into `count` groups that sum to it."""
    light = np.asarray(frame.indirect)
    shares = np.random.default_rng(0).dirichlet(np.ones(count), light.shape[:2])
    parts = light[:, :, None, :] * shares[..., None].astype(np.float32)
    return dataclasses.replace(frame, indirect=parts.reshape(*light.shape[:2], 3 * count))


def error_of_sum(frame: Frame, count: int, backend: str) -> float:
    """Largest difference of the denoised groups' sum from the denoised sum, per mean light."""
    whole = np.asarray(jflnr.denoise(frame, backend=backend))
    parts = np.asarray(jflnr.denoise(grouped(frame, count), backend=backend))
    total = parts.reshape(*whole.shape[:2], count, 3).sum(axis=2)
    return float(np.abs(total - whole).max() / whole.mean())


def draw(result: dict[str, Any], folder: Path) -> None:
    """lightgroups.png: time against the number of groups; lightgroups.md."""
    columns = {"backend": "backend", "groups": "light groups", "ms": "together, ms"}
    columns |= {"separate_ms": "one by one, ms", "error": "largest error of the sum / mean light"}
    plots.write_text(folder / f"{NAME}.md", results.table(result["rows"], columns))
    with plots.figure(folder / f"{NAME}.png") as axis:
        for backend in dict.fromkeys(row["backend"] for row in result["rows"]):
            mine = [row for row in result["rows"] if row["backend"] == backend]
            groups = [row["groups"] for row in mine]
            (line,) = axis.plot(groups, [r["ms"] for r in mine], "o-", label=f"{backend}, together")
            axis.plot(
                groups,
                [row["separate_ms"] for row in mine],
                "s--",
                color=line.get_color(),
                label=f"{backend}, one by one",
            )
        axis.set(xlabel="light groups of 3 channels", ylabel="milliseconds at 640 x 360")
        axis.set_ylim(bottom=0)
        axis.legend()
