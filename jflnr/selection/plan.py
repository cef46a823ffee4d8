"""What to denoise a frame with: what is predicted of each form, and the smallest that is enough."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.flr.parameters import DEFAULT
from jflnr.flr.regression import flr
from jflnr.frame import Array
from jflnr.selection.blocks import Models

# How a picture is shown where its error is measured (`jflnr.metrics`, which no denoiser imports).
MEAN_BRIGHTNESS, GAMMA = 0.35, 2.2

# From the smallest to the largest; the first is `blocks.py`.
BLOCKS = "blocks"
FORMS = (BLOCKS, "flr-adaptive", "flnr")
# Time per pixel, in that of plain FLR with five guides.
COSTS = dict(zip(FORMS, (1.4, 2.5, 2.9), strict=True))
# What looking at a frame has cost when a larger form is taken after all.
LOOK = 0.9
# Decibels that a form must bring for each further FLR of time.
PRICE = 0.3
# A guide is read at every pixel if inside blocks it does more than this share of the squared error.
WORTH = 1e-3


class Look(NamedTuple):
    """A frame as the smallest form sees it; the arguments of the predictions.

    decibels: PSNR that the expected error leaves. share: of the finest step that is signal.
    noise: logarithm of the expected relative error, mean over the blocks. order: groups of guides
    in use. width: halvings of the coarsest window.
    """

    decibels: float
    share: float
    noise: float
    order: float
    width: float


# Decibels = these times (1, decibels, share, noise, order, width): fitted on 97 training
# frames at 1 and 4 samples per pixel (docs/select.md).
PREDICTIONS = {
    "blocks": (11.98, 0.3627, -3.287, -6.12, -2.359, 0.9175),
    "flr-adaptive": (12.48, 0.3251, -1.754, -6.418, -2.199, 0.7396),
    "flnr": (13.4, 0.2942, -1.867, -6.534, -2.246, 0.7748),
}


@dataclass(frozen=True)
class Plan:
    """What a frame is denoised with, and why.

    form: one of FORMS. guides: those used. decibels: predicted PSNR of every form. cost: predicted
    time of every form in that of plain FLR. milliseconds: on this device, of the chosen form; None
    unless it was asked for. order: `(h, w)`, how many of the `groups` of guides are in use, block
    by block.
    """

    form: str
    guides: tuple[str, ...]
    decibels: Mapping[str, float]
    cost: Mapping[str, float]
    milliseconds: float | None
    order: np.ndarray
    groups: int

    def lines(self) -> list[str]:
        """The plan in a few lines for a person."""
        chosen = self.decibels[self.form]
        others = ", ".join(
            f"{form} {value - chosen:+.1f} dB for x {self.cost[form] / self.cost[self.form]:.1f}"
            for form, value in self.decibels.items()
            if form != self.form
        )
        time = "" if self.milliseconds is None else f", {self.milliseconds:.0f} ms predicted"
        counts = np.bincount(np.round(self.order).astype(int).ravel(), minlength=self.groups + 1)
        shares = ", ".join(f"{n}: {count / counts.sum():.0%}" for n, count in enumerate(counts))
        return [
            f"plan: {self.form} with {', '.join(self.guides) or 'no guides'}, "
            f"{chosen:.1f} dB predicted{time}",
            f"instead: {others}",
            f"groups of guides in use, by blocks: {shares}",
        ]


def look_at(models: Models, count: Array) -> Look:
    """Numbers of one frame from the models of its blocks.

    count: `(h, w)`, how much of each block can be used.
    """
    level, error, share, order, width = (
        np.asarray(planes, np.float64)
        for planes in (models.level, models.error, models.share, models.order, models.width)
    )
    used = np.asarray(count) > 0
    used = used if used.any() else np.ones_like(used)
    mean = float(models.mean)
    scale = MEAN_BRIGHTNESS / mean
    shown = np.clip(scale * level, 1e-2, 1)
    slope = np.where(scale * level < 1, scale / GAMMA * shown ** (1 / GAMMA - 1), 0)
    displayed = max(float(np.mean((error * slope**2)[used])), 1e-9)
    relative = error / (level**2 + 0.01 * mean**2)
    return Look(
        decibels=-10 * float(np.log10(displayed)),
        share=float(np.mean(share[used])),
        noise=float(np.mean(np.log10(np.maximum(relative[used], 1e-9)))),
        order=float(np.mean(order[used])),
        width=float(np.mean(width[used])),
    )


def predict(look: Look) -> dict[str, float]:
    """PSNR that every form is expected to reach."""
    values = np.array([1, look.decibels, look.share, look.noise, look.order, look.width])
    return {form: float(values @ np.array(weights)) for form, weights in PREDICTIONS.items()}


def worth_reading(models: Models, names: Sequence[str]) -> tuple[str, ...]:
    """The guides that do something inside blocks; the others may be held at each block's mean."""
    expected = float(jnp.mean(models.error))
    gains = np.asarray(models.gains)
    return tuple(n for n, gain in zip(names, gains, strict=True) if gain > WORTH * expected)


def plan(
    look: Look,
    names: tuple[str, ...],
    order: np.ndarray,
    pixels: int,
    seconds: float | None,
    budget_ms: float | None,
    target_db: float | None,
    forms: Sequence[str] = FORMS,
) -> Plan:
    """The plan for a frame. seconds: per pixel of plain FLR, or None if no time is asked for.

    order: `(h, w)`, of the blocks that the look was taken at. forms: those that can be used.
    """
    decibels = {form: value for form, value in predict(look).items() if form in forms}
    cost = {form: COSTS[form] + (0 if form == BLOCKS else LOOK) for form in forms}
    ms = None if seconds is None else {form: 1e3 * seconds * pixels * c for form, c in cost.items()}
    form = choose(decibels, cost, ms, budget_ms, target_db)
    return Plan(form, names, decibels, cost, None if ms is None else ms[form], order, len(names))


def choose(
    decibels: Mapping[str, float],
    cost: Mapping[str, float],
    milliseconds: Mapping[str, float] | None,
    budget_ms: float | None,
    target_db: float | None,
) -> str:
    """The form to take, out of those in `decibels`, from the cheapest to the dearest.

    With a target the cheapest form that is expected to reach it, or else the best. With a budget
    none that is expected to take longer, unless all do: then the cheapest. With neither, the one
    whose last decibel is worth its time (PRICE).
    """
    forms = list(decibels)
    if budget_ms is not None and milliseconds is not None:
        forms = [form for form in forms if milliseconds[form] <= budget_ms] or forms[:1]
    best = max(forms, key=lambda form: decibels[form])
    if target_db is not None:
        return next((form for form in forms if decibels[form] >= target_db), best)
    if budget_ms is not None:
        return best
    return max(forms, key=lambda form: decibels[form] - PRICE * cost[form])


@functools.cache
def seconds_per_pixel() -> float:
    """Time that plain FLR with five guides takes on this device, measured once per process."""
    height, width = 360, 640
    generator = np.random.default_rng(0)
    target, guides = (jnp.asarray(generator.random((height, width, c), np.float32)) for c in (3, 5))
    compiled = jax.jit(flr)
    times = []
    for _ in range(4):
        start = time.perf_counter()
        compiled(target, guides, DEFAULT).block_until_ready()
        times.append(time.perf_counter() - start)
    return min(times[1:]) / (height * width)
