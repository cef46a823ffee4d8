"""Time of a frame of a sequence, 1280 x 720: BMFR and our methods with a history."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments import plots, results
from experiments.methods import backends
from experiments.peers import svgf
from experiments.shots import made_up
from experiments.speed import enlarge, finished, interleaved
from jflnr import temporal
from jflnr.frame import Frame
from jflnr.temporal import bmfr, sequence

NAME = "sequence_speed"
QUESTION = "What does a frame with a history take, against BMFR and the memory floor?"
MINUTES = 2

WIDTH, HEIGHT = 1280, 720
BMFR = {"per_bmfr": "BMFR, JAX", "per_kernels": "BMFR, OpenCL"}
COLUMNS = {"method": "method", "ms": "ms", "floors": "x floor"} | {
    key: f"x {name}" for key, name in BMFR.items()
}


def run(quick: bool) -> dict[str, Any]:
    """Milliseconds a frame, the best of several; every method in turn."""
    size = (90, 160) if quick else (HEIGHT, WIDTH)
    before, now = (enlarge(frame, *size) for frame in made_up(2).frames)
    calls = by_kernels(before, now) | by_jax(before, now)
    seconds = interleaved(calls, 2 if quick else 15)
    rows = [
        {
            "method": name,
            "ms": 1e3 * t,
            "floors": t / seconds["memory floor"],
        }
        | {key: t / seconds[other] for key, other in BMFR.items() if other in seconds}
        for name, t in seconds.items()
    ]
    return {"device": jax.default_backend(), "width": size[1], "height": size[0], "rows": rows}


def by_jax(before: Frame, now: Frame) -> dict[str, Callable[[], Any]]:
    """Name to a call that denoises `now` after `before`, and waits; and the memory floor."""
    source = np.ones((*now.depth.shape[:2], 8), np.float32)  # five guides and the light
    target = np.zeros_like(source)
    found: dict[str, Callable[[], Any]] = {"memory floor": lambda: np.copyto(target, source)}
    frames = [jax.tree.map(jnp.asarray, frame) for frame in (before, now)]
    for method in sequence.METHODS:
        step = functools.partial(temporal.step, method=method)
        found[f"{method}, temporal, JAX"] = second(temporal.start, step, *frames)
    found["BMFR, JAX"] = second(bmfr.start, bmfr.step, *frames)
    return found | {"SVGF, JAX": second(svgf.start, svgf.step, *frames)}


def by_kernels(before: Frame, now: Frame) -> dict[str, Callable[[], Any]]:
    """The same by the kernels, if there is a device."""
    found: dict[str, Callable[[], Any]] = {}
    if "opencl" in backends():
        from jflnr.opencl import bmfr as bmfr_kernels
        from jflnr.opencl import temporal as kernels

        for method in sequence.METHODS:
            step = functools.partial(kernels.step, method=method)
            found[f"{method}, temporal, OpenCL"] = second(kernels.start, step, before, now)
        found["BMFR, OpenCL"] = second(bmfr_kernels.start, bmfr_kernels.step, before, now)
    return found


def second(
    start: Callable[[Frame], Any], step: Callable[..., Any], before: Frame, now: Frame
) -> Callable[[], Any]:
    """A call of the step from the first frame to the second."""
    state = jax.block_until_ready(step(start(before), before)[0])
    return functools.partial(finished, functools.partial(step, state, now))


def draw(result: dict[str, Any], folder: Path) -> None:
    """sequence_speed.md; with the device's name in it where that is a GPU."""
    stem = NAME if result["device"] == "cpu" else f"{NAME}-{result['device']}"
    plots.write_text(folder / f"{stem}.md", results.table(result["rows"], COLUMNS))
