"""Which guides matter: greedy selection, as in section 5 of BMFR."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, results, resume
from experiments.methods import Method
from experiments.timing import times
from experiments.tune import mean_psnr
from jflnr.regression.parameters import DEFAULT
from jflnr.regression.flr import flr
from jflnr.frame import Array, Frame
from jflnr.guides import NAMES

NAME = "guide_choice"
QUESTION = "Which guides matter for FLR and FLNR, in which order, and what does each cost?"
MINUTES = 2

# FLNR takes these three always: what they are worth is what is lost without one.
LEFT_OUT = ("normal", "depth", "ao")
METHODS = ("flr", "flr-adaptive", "flnr")


def run(quick: bool) -> dict[str, Any]:
    """Add the guide that raises the mean PSNR over val most, one after the other; report test."""
    tag = "-quick" * quick
    choice, test = (
        [data.read(path) for path in ([data.SHIPPED] if quick else data.frames(split))]
        for split in ("val", "test")
    )

    def score(key: str) -> dict[str, float]:
        names = [name for name in key.split("+") if name]
        return {
            "val": mean_psnr(choice, guided_by, {"guides": names}),
            "test": mean_psnr(test, guided_by, {"guides": names}),
        }

    chosen: list[str] = []
    steps = [{"added": "none", "guides": ""} | resume.rows(f"{NAME}-0{tag}", [""], score)[0]]
    candidates = list(NAMES[:2] if quick else NAMES)
    tried = []
    while candidates:
        keys = ["+".join([*chosen, name]) for name in candidates]
        scores = resume.rows(f"{NAME}-{len(chosen) + 1}{tag}", keys, score)
        tried += [{"guides": key} | s for key, s in zip(keys, scores, strict=True)]
        best = int(np.argmax([s["val"] for s in scores]))
        steps.append({"added": candidates[best], "guides": keys[best]} | scores[best])
        chosen.append(candidates.pop(best))
    methods = [
        Method(step["guides"], "jflnr", jflnr.denoise, {"guides": tuple(step["guides"].split("+"))})
        for step in steps[1:]
    ]
    clock = times(methods, test[0], quick)
    for step in steps[1:]:
        step["ms"] = clock[step["guides"]]
    keys = [f"{method}|{name}" for method in METHODS for name in ("", *LEFT_OUT)]

    def left_out(key: str) -> dict[str, Any]:
        method, name = key.split("|")
        parameters = {"method": method, "name": name}
        psnr = [mean_psnr(frames, without, parameters) for frames in (choice, test)]
        return {"method": method, "without": name} | dict(zip(("val", "test"), psnr, strict=True))

    missing = resume.rows(f"{NAME}-missing{tag}", keys, left_out)
    return {"steps": steps, "tried": tried, "missing": missing}


def without(frame: Frame, *, method: str, name: str) -> Array:
    """A method on a frame of which one guide, if named, is the same everywhere."""
    if name:
        layer = np.asarray(getattr(frame, name))
        same = np.broadcast_to(np.mean(layer, axis=(0, 1), dtype=layer.dtype), layer.shape)
        frame = dataclasses.replace(frame, **{name: np.ascontiguousarray(same)})
    return jflnr.denoise(frame, method)


def guided_by(frame: Frame, *, guides: Sequence[str]) -> Array:
    """FLR with these guides; without any it is the Gaussian blur of the light."""
    if guides:
        return jflnr.denoise(frame, guides=guides)
    light = jnp.asarray(frame.indirect)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0]
    return flr(light, light[..., :0], DEFAULT, weight=weight)


def draw(result: dict[str, Any], folder: Path) -> None:
    """guide_choice.png: PSNR and time as guides are added; guide_choice.md: all that was tried."""
    steps = result["steps"]
    columns = {"added": "added", "val": "PSNR, val", "test": "PSNR, test", "ms": "ms, 640 x 360"}
    psnr = {"val": "PSNR, val", "test": "PSNR, test"}
    tried = results.table(result["tried"], {"guides": "guides"} | psnr)
    missing = results.table(result["missing"], {"method": "method", "without": "without"} | psnr)
    plots.write_text(
        folder / f"{NAME}.md", "\n".join([results.table(steps, columns), tried, missing])
    )
    labels = [steps[0]["added"], *(f"+ {step['added']}" for step in steps[1:])]
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        places = range(len(steps))
        left.plot(places, [step["val"] for step in steps], "o-", label="val (chosen on)")
        left.plot(places, [step["test"] for step in steps], "s--", label="test")
        right.plot(places[1:], [step["ms"] for step in steps[1:]], "o-")
        for axis in (left, right):
            axis.set_xticks(places, labels, rotation=30, ha="right")
        left.set(ylabel="PSNR at 1 spp, dB")
        left.legend()
        right.set(ylabel="milliseconds at 640 x 360", ylim=(0, None))
