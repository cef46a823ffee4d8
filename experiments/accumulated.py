"""What to average over time: input, moments, coefficients, output, alone and together."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments import resume, shots, temporal_metrics
from experiments.results import Parts, pivoted
from jflnr import stages
from jflnr.frame import Array, Frame
from jflnr.images.inputs import prepare
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.stages import Known, Stage
from jflnr.temporal import Average, Surface, accumulate, find_taps, reproject
from jflnr.temporal.accumulate import nothing

NAME = "accumulated"
QUESTION = "What is best averaged over time: input, moments, coefficients or output?"
MINUTES = 12

VARIANTS = (
    "nothing",
    "input",
    "moments",
    "coefficients",
    "output",
    "input, coefficients",
    "moments, output",
    "input, output",
)
FOLLOWING = "input, output, following the light"
SETTLED = 8
METHOD = AdaptiveFLR()
# Frames are cut to whole blocks of pass 1.
BLOCK = METHOD.finest
# What the stages give that is averaged.
PARTS = {
    "nothing": (),
    "input": ("target",),
    "moments": ("light", "counted", "moments"),
    "coefficients": ("models",),
    "output": ("image",),
}
# Least share of a new frame; of a new output where what it was fitted to is an average already.
LEAST, LEAST_OUTPUT = 0.05, 0.3

TABLES = {"psnr": "PSNR, dB", "warped": "warped error", "lag": "lag in frames"}

State = dict[str, Any]


def run(quick: bool) -> Parts:
    """PSNR, flicker and lag of every variant on the sequences of train and val."""
    names = ["made up"] if quick else shots.names()
    names = [name for name in names if shots.load(name).split != "test"]
    keys = [f"{name}|{variant}" for name in names for variant in (*VARIANTS, FOLLOWING)]

    def row(key: str) -> dict[str, Any]:
        name, variant = key.split("|")
        return {"shot": name.replace("_", ", "), "averaged": variant} | measured(
            shots.load(name), variant
        )

    rows = resume.rows(f"{NAME}{'-quick' * quick}", keys, row)
    return {title: pivoted(rows, "averaged", "shot", key) for key, title in TABLES.items()}


def measured(shot: shots.Shot, variant: str) -> dict[str, Any]:
    """Means over the frames after the first ones, and the lag where the light changes."""
    frames = [jax.tree.map(whole_blocks, frame) for frame in shot.frames]
    if variant == FOLLOWING:
        images = shots.with_history("flr-adaptive")(frames)
    else:
        images = denoise(frames, frozenset(variant.split(", ")))
    rows = temporal_metrics.measure_sequence(frames, images)[min(SETTLED, len(frames) - 1) :]
    found = {key: float(np.mean([row[key] for row in rows])) for key in ("psnr", "warped")}
    truth = np.stack([np.asarray(frame.reference) for frame in frames])
    if shot.motion == "light":
        found["lag"] = temporal_metrics.lag(np.stack(images), truth)
    if shot.motion == "switch":
        followed = temporal_metrics.response(np.stack(images), truth[0], truth[-1])
        found["lag"] = float(np.sum(1 - followed[len(truth) // 2 :]))
    return found


def whole_blocks(layer: Array) -> Array:
    """The layer without what is left over of blocks at its right and lower border."""
    height, width = (size - size % (2 * BLOCK) for size in layer.shape[:2])
    return layer[:height, :width]


def denoise(frames: Sequence[Frame], averaged: frozenset[str]) -> list[np.ndarray]:
    """Adaptive FLR with a history of what is named."""
    names, _ = prepare(frames[0], None, METHOD)
    known = METHOD.known(METHOD.images(frames[0], names))
    state, images = start(frames[0]), []
    for frame in frames:
        state, image = step(state, frame, known, names, averaged)
        images.append(np.asarray(image))
    return images


def start(frame: Frame) -> State:
    """Nothing known of anything that may be averaged."""
    height, width = frame.depth.shape[:2]
    guides = 4 + (frame.ao is not None)
    products = (guides + 1) * (guides + 2) // 2
    h, w = height // BLOCK, width // BLOCK
    return {
        "surface": jax.tree.map(lambda layer: jnp.zeros(layer.shape), Surface.of(frame)),
        "target": nothing(height, width, 3),
        "light": nothing(h // 2, w // 2, products + guides + 1),
        "counted": nothing(h // 2, w // 2, 2),
        "moments": nothing(h, w, products + 3 * (guides + 1) + 1),
        "models": nothing(h, w, 3 * (guides + 2)),
        "image": nothing(height, width, 3),
    }


@functools.partial(jax.jit, static_argnames=("names", "averaged"))
def step(
    state: State, frame: Frame, known: Known, names: tuple[str, ...], averaged: frozenset[str]
) -> tuple[State, jax.Array]:
    """`flr_adaptive` with averages between its stages. known: one for all frames."""
    images, state = METHOD.images(frame, names), dict(state)
    weight = images["weight"]
    weight = jnp.ones(frame.depth.shape[:2]) if weight is None else jnp.where(weight, 1.0, 0.0)
    here, before = Surface.of(frame), state["surface"]
    kept = [name for some in averaged for name in PARTS[some]]

    def average(parts: stages.Parts, name: str, side: int) -> Any:
        planes = jnp.moveaxis(parts[name], -1, 0) if side == 0 else parts[name]
        image = jnp.moveaxis(planes.reshape(-1, *planes.shape[-2:]), 0, -1)
        again = name == "image" and len(averaged) > 1
        past = moved(state[name], frame, before, side or 1)
        state[name] = accumulate(past, image, LEAST_OUTPUT if again else LEAST)
        mean = state[name].mean
        return mean if side == 0 else jnp.moveaxis(mean, -1, 0).reshape(planes.shape)

    def averaging(stage: Stage) -> Stage:
        def with_history(method: Any, parts: stages.Parts, known: Known) -> stages.Parts:
            given = stage.run(method, parts, known)
            sides = dict(stage.gives + stage.totals)
            given |= {name: average(given, name, sides[name]) for name in kept if name in given}
            if "moments" in kept and "moments" in given:
                # The mean of n frames has an n-th of the variance of one.
                noise = given["moments"][-1] / state["moments"].samples[..., 0]
                given["moments"] = given["moments"].at[-1].set(noise)
            return given

        return dataclasses.replace(stage, run=with_history)

    if "target" in kept:
        images["target"] = average({"target": jnp.asarray(images["target"])}, "target", 1)
        weight *= state["target"].samples[..., 0]
    parts, _ = stages.run(
        [averaging(stage) for stage in METHOD.stages()], METHOD, images | {"weight": weight}, known
    )
    return state | {"surface": here}, parts["image"]


def moved(average: Average, frame: Frame, before: Surface, block: int) -> Average:
    """An average on blocks, where the blocks are now by what their middle pixels show."""
    middle = slice(block // 2, None, block)
    motion, *surfaces = jax.tree.map(
        lambda layer: jnp.asarray(layer)[middle, middle],
        (frame.motion, Surface.of(frame), before),
    )
    return reproject(average, find_taps(motion / block, *surfaces, off_plane=0.01 * block))
