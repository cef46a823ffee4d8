"""What to average over time: input, moments, coefficients, output, alone and together."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments import plots, results, resume, shots
from jflnr import temporal_metrics
from jflnr.regression import adaptive, energy, widths
from jflnr.regression.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.regression.apply import apply, with_borders
from jflnr.regression.moments import centre
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images, prepare
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
# Side of the blocks of the finest models; frames are cut to whole blocks of pass 1.
BLOCK = 4
# Least share of a new frame; of a new output where what it was fitted to is an average already.
LEAST, LEAST_OUTPUT = 0.05, 0.3

State = dict[str, Any]


def run(quick: bool) -> dict[str, Any]:
    """PSNR, flicker and lag of every variant on the sequences of train and val."""
    names = ["made up"] if quick else shots.names()
    names = [name for name in names if shots.load(name).split != "test"]
    keys = [f"{name}|{variant}" for name in names for variant in (*VARIANTS, FOLLOWING)]

    def row(key: str) -> dict[str, Any]:
        name, variant = key.split("|")
        return {"shot": name, "variant": variant} | measured(shots.load(name), variant)

    return {"rows": resume.rows(f"{NAME}{'-quick' * quick}", keys, row)}


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
    (names, _), state, images = prepare(frames[0], None), start(frames[0]), []
    shift = centre(adaptive_images(frames[0], names)["guides"])
    for frame in frames:
        state, image = step(state, frame, shift, names, averaged)
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
        "input": nothing(height, width, 3),
        "light": nothing(h // 2, w // 2, products + guides + 1),
        "moments": nothing(h, w, products + 3 * (guides + 1) + 1),
        "coefficients": nothing(h, w, 3 * (guides + 1)),
        "output": nothing(height, width, 3),
    }


@functools.partial(jax.jit, static_argnames=("names", "averaged"))
def step(
    state: State,
    frame: Frame,
    shift: jax.Array,
    names: tuple[str, ...],
    averaged: frozenset[str],
) -> tuple[State, jax.Array]:
    """`flr_adaptive` with averages between its steps. shift: one for all frames."""
    images, state = adaptive_images(frame, names), dict(state)
    target, guides, weight = jnp.asarray(images["target"]), images["guides"], images["weight"]
    weight = jnp.ones(target.shape[:2]) if weight is None else jnp.where(weight, 1.0, 0.0)
    here, before, numbers = Surface.of(frame), state["surface"], ADAPTIVE_DEFAULT.numbers()

    def average(name: str, image: jax.Array, block: int, least: float = LEAST) -> jax.Array:
        state[name] = accumulate(moved(state[name], frame, before, block), image, least)
        return state[name].mean

    if "input" in averaged:
        target = average("input", target, 1)
        weight *= state["input"].samples[..., 0]
    light = adaptive.collect_light(target, guides, shift, weight, BLOCK)
    if "moments" in averaged:
        light = to_planes(average("light", to_image(light), 2 * BLOCK))
    mean = adaptive.frame_mean(light, shift.size)
    models = adaptive.fit_pilot(light, mean, shift, numbers, BLOCK)
    pilot = adaptive.Pilot(with_borders(models), mean)
    grid = adaptive.collect_grid(target, guides, shift, pilot, weight, numbers, BLOCK)
    if "moments" in averaged:
        together = to_image(jnp.concatenate([grid.moments, grid.noise]))
        planes = to_planes(average("moments", together, BLOCK))
        # The mean of n frames has an n-th of the variance of one.
        noise = planes[-1:] / to_planes(state["moments"].samples)
        grid = grid._replace(moments=planes[:-1], noise=noise)
    levels = widths.fit_levels(grid, shift, 3, adaptive.LEVELS, mean, numbers)
    models = energy.restore(widths.merged_models(*levels), light, shift.size, numbers.slack)
    if "coefficients" in averaged:
        flat = to_image(models.reshape(-1, *models.shape[2:]))
        models = to_planes(average("coefficients", flat, BLOCK)).reshape(models.shape)
    image = apply(models, guides, shift, BLOCK)
    if "output" in averaged:
        image = average("output", image, 1, LEAST if len(averaged) == 1 else LEAST_OUTPUT)
    return state | {"surface": here}, image


def moved(average: Average, frame: Frame, before: Surface, block: int) -> Average:
    """An average on blocks, where the blocks are now by what their middle pixels show."""
    middle = slice(block // 2, None, block)
    motion, *surfaces = jax.tree.map(
        lambda layer: jnp.asarray(layer)[middle, middle],
        (frame.motion, Surface.of(frame), before),
    )
    return reproject(average, find_taps(motion / block, *surfaces, off_plane=0.01 * block))


def to_image(planes: jax.Array) -> jax.Array:
    return jnp.moveaxis(planes, 0, -1)


def to_planes(image: jax.Array) -> jax.Array:
    return jnp.moveaxis(image, -1, 0)


def draw(result: dict[str, Any], folder: Path) -> None:
    """accumulated.md: PSNR, warped error and lag, variants down and sequences across."""
    parts = [
        f"PSNR in dB\n\n{table(result['rows'], 'psnr')}",
        f"Warped temporal error x 1000\n\n{table(result['rows'], 'warped', 1000)}",
        f"Lag in frames\n\n{table(result['rows'], 'lag')}",
    ]
    plots.write_text(folder / f"{NAME}.md", "\n".join(parts))


def table(rows: Sequence[dict[str, Any]], key: str, factor: float = 1) -> str:
    """One metric."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        if key in row:
            line = lines.setdefault(row["variant"], {"variant": row["variant"]})
            line[row["shot"]] = factor * row[key]
    shown = dict.fromkeys(row["shot"] for row in rows if key in row)
    columns = {"variant": "averaged"} | {name: name.replace("_", ", ") for name in shown}
    return results.table(list(lines.values()), columns)
