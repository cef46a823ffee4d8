"""What to denoise a frame with: what is predicted of each form, and the smallest that is enough."""

import functools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.auto.blocks import Models
from jflnr.regression.flr import flr

# How a picture is shown where its error is measured (`jflnr.metrics`, which no denoiser imports).
MEAN_BRIGHTNESS, GAMMA = 0.35, 2.2

# From the smallest to the largest. Those of `blocks.py` are named after their whole models.
# Side in pixels of the blocks that they collect, on which their images are evaluated.
COLLECTED = {"blocks-16": 8, "blocks-8": 4, "blocks-4": 4}
BLOCKS = tuple(COLLECTED)
FORMS = (*BLOCKS, "flnr")
# Time per pixel, in that of plain FLR with five guides (the experiment `parsimony`).
COSTS = dict(zip(FORMS, (1.4, 3.5, 5.0, 6.9), strict=True))
# What looking at a frame by a form has cost when a larger one is taken after all that does not
# go on from it.
LOOKS = {"blocks-16": 0.9, "blocks-8": 2.4}
# Decibels that a form must bring for each further FLR of time.
PRICE = 0.08
# A guide is read at every pixel if inside blocks it does more than this share of the squared error.
WORTH = 1e-4


class Limits(NamedTuple):
    """What the user asks for, and the time per pixel of plain FLR if it was measured."""

    budget_ms: float | None = None
    target_db: float | None = None
    seconds: float | None = None


class Statistics(NamedTuple):
    """A frame as the form that is tried first sees it; the arguments of the predictions.

    decibels: PSNR that the expected error leaves. share: of the finest step that is signal.
    noise: logarithm of the expected relative error, mean over the blocks. order: groups of guides
    in use. width: halvings of the coarsest window.
    """

    decibels: float
    share: float
    noise: float
    order: float
    width: float


# By the form that looks, then by form: decibels = these times (1, decibels, share, noise, order,
# width), fitted by the experiment `predictions`.
PREDICTIONS = {
    "blocks-16": {
        "blocks-16": (13.59, 0.06335, -6.818, -0.775, 3.076, 2.201),
        "blocks-8": (13.42, 0.06355, -5.421, -0.7827, 2.812, 2.702),
        "blocks-4": (13.74, 0.06199, -4.782, -0.7885, 2.692, 2.699),
        "flnr": (14.58, 0.05396, -4.441, -0.8289, 2.473, 2.749),
    },
    "blocks-8": {
        "blocks-8": (14.49, 0.07132, -12.6, -0.6281, 2.677, 2.213),
        "blocks-4": (14.67, 0.07194, -11.53, -0.6205, 2.554, 2.282),
        "flnr": (15.61, 0.06707, -10.17, -0.644, 2.315, 2.241),
    },
}


@dataclass(frozen=True)
class Plan:
    """What a frame is denoised with, and why.

    form: one of FORMS. guides: those used. decibels: predicted PSNR of every form. cost: predicted
    time of every form in that of plain FLR. milliseconds: on this device, of the chosen form; None
    unless it was asked for. order: `(h, w)`, how many of the `groups` of guides are in use, by
    blocks of `side` pixels.
    """

    form: str
    guides: tuple[str, ...]
    decibels: Mapping[str, float]
    cost: Mapping[str, float]
    milliseconds: float | None
    order: np.ndarray
    side: int
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


def statistics_of(models: Models) -> Statistics:
    """Numbers of one frame from the models of its blocks."""
    luminance, error, share, order, width = (
        np.asarray(planes, np.float64)
        for planes in (models.luminance, models.error, models.share, models.order, models.width)
    )
    used = np.asarray(models.usable) > 0
    used = used if used.any() else np.ones_like(used)
    mean = float(models.mean)
    scale = MEAN_BRIGHTNESS / mean
    shown = np.clip(scale * luminance, 1e-2, 1)
    slope = np.where(scale * luminance < 1, scale / GAMMA * shown ** (1 / GAMMA - 1), 0)
    displayed = max(float(np.mean((error * slope**2)[used])), 1e-9)
    relative = error / (luminance**2 + 0.01 * mean**2)
    return Statistics(
        decibels=-10 * float(np.log10(displayed)),
        share=float(np.mean(share[used])),
        noise=float(np.mean(np.log10(np.maximum(relative[used], 1e-9)))),
        order=float(np.mean(order[used])),
        width=float(np.mean(width[used])),
    )


def worth_reading(models: Models, names: Sequence[str]) -> tuple[str, ...]:
    """The guides that do something inside blocks; the others may be held at each block's mean."""
    expected = float(jnp.mean(models.error))
    gains = np.asarray(models.gains)
    return tuple(n for n, gain in zip(names, gains, strict=True) if gain > WORTH * expected)


def start_of(form: str) -> str:
    """The form that this one goes on from, or itself: both come from the same moments."""
    return "blocks-8" if form == "blocks-4" else form


def first(simple: bool, limits: Limits, pixels: int) -> str:
    """The form to begin with. simple: whether the frame looked so at a glance.

    With a budget that leaves time for more, even a simple frame gets more.
    """
    if limits.budget_ms is not None and limits.seconds is not None:
        simple = 1e3 * limits.seconds * pixels * COSTS["blocks-8"] > limits.budget_ms
    return "blocks-16" if simple else "blocks-8"


def plan(
    first: str,
    statistics: Statistics,
    names: tuple[str, ...],
    order: np.ndarray,
    pixels: int,
    limits: Limits,
    network: bool,
) -> Plan:
    """The plan for a frame that the form `first` has looked at.

    order: `(h, w)`, of the blocks of that form. network: whether flnr can be used.
    """
    values = np.array([1, *statistics])
    decibels = {form: float(values @ np.array(w)) for form, w in PREDICTIONS[first].items()}
    if not network:
        del decibels["flnr"]
    cost = {
        form: COSTS[form] + (0 if start_of(form) == first else LOOKS[first]) for form in decibels
    }
    ms = None
    if limits.seconds is not None:
        ms = {form: 1e3 * limits.seconds * pixels * c for form, c in cost.items()}
    form = choose(first, decibels, cost, ms, limits)
    time = None if ms is None else ms[form]
    return Plan(form, names, decibels, cost, time, order, COLLECTED[first], len(names))


def choose(
    first: str,
    decibels: Mapping[str, float],
    cost: Mapping[str, float],
    milliseconds: Mapping[str, float] | None,
    limits: Limits,
) -> str:
    """The form to take, out of those in `decibels`, from the cheapest to the dearest.

    With a target the cheapest form that is expected to reach it, or else the best. With a budget
    none that is expected to take longer, unless all do: then the cheapest. With neither, the one
    whose last decibel is worth its time (PRICE): a simple frame stays with the form for such, which
    has looked first, and none goes on to the network, as which frames gain by it cannot be
    predicted (docs/select.md).
    """
    forms = list(decibels)
    if limits.budget_ms is not None and milliseconds is not None:
        forms = [form for form in forms if milliseconds[form] <= limits.budget_ms] or forms[:1]
    best = max(forms, key=lambda form: decibels[form])
    if limits.target_db is not None:
        return next((form for form in forms if decibels[form] >= limits.target_db), best)
    if limits.budget_ms is not None:
        return best
    small = BLOCKS[:1] if first == BLOCKS[0] else BLOCKS[1:]
    return max(small, key=lambda form: decibels[form] - PRICE * cost[form])


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
        compiled(target, guides).block_until_ready()
        times.append(time.perf_counter() - start)
    return min(times[1:]) / (height * width)
