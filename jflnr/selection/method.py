"""`jflnr.select` and the method `auto` of `jflnr.denoise`."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.flnr.features import GUIDES
from jflnr.flr.adaptive import light_of
from jflnr.flr.apply import apply
from jflnr.flr.energy import rescale
from jflnr.frame import Array, Frame
from jflnr.inputs import flr_images, prepare
from jflnr.selection import plan as plans
from jflnr.selection.blocks import BLOCK, Collected, Models, collect_frame, fit, hold


def select(
    frame: Frame,
    budget_ms: float | None = None,
    target_db: float | None = None,
    *,
    guides: Sequence[str] | None = None,
) -> tuple[plans.Plan, Array]:
    """Denoise a frame with the smallest model that is good enough for it (docs/select.md).

    frame, guides: as of `denoise`. budget_ms: time that denoising may take, by prediction; the
    first call measures the device, in a second or two. target_db: PSNR to be reached, by
    prediction, as cheaply as possible.
    Returns the plan, with predicted error and time, and the light, `(H, W, C)`.

    Raises `ValueError` or `TypeError` as `denoise` does, and for a budget that is not positive.
    """
    for name, value in (("budget_ms", budget_ms), ("target_db", target_db)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; it must be a positive number")
    names, inputs = prepare(frame, guides)
    return select_inputs(inputs, names, budget_ms, target_db, plans.seconds_per_pixel())


def select_inputs(
    frame: Frame,
    names: tuple[str, ...],
    budget_ms: float | None = None,
    target_db: float | None = None,
    seconds: float | None = None,
    keep_energy: bool = False,
) -> tuple[plans.Plan, Array]:
    """`select` of what `prepare` returned. seconds: per pixel, of plain FLR on this device."""
    plan, collected, models = _planned(frame, names, seconds, budget_ms, target_db)
    if plan.form != plans.BLOCKS:
        from jflnr.denoising import denoise

        return plan, denoise(frame, plan.form, guides=names, keep_energy=keep_energy)
    return plan, _apply(frame, collected, models, names, plan.guides, keep_energy)


def _planned(
    frame: Frame,
    names: tuple[str, ...],
    seconds: float | None,
    budget_ms: float | None = None,
    target_db: float | None = None,
) -> tuple[plans.Plan, Collected, Models]:
    """The plan, and the moments and models of the smallest form, which it rests on."""
    if frame.indirect.shape[:2] != frame.normal.shape[:2]:
        raise ValueError("method auto needs frame.indirect at the size of the guides")
    collected = _collect(frame, names)
    models = fit(collected, _groups(frame, names))
    look = plans.look_at(models, collected.moments[0])
    network = sorted(names) == sorted(GUIDES) and frame.indirect.shape[-1] == 3
    forms = plans.FORMS if network else plans.FORMS[:-1]
    limits = seconds, budget_ms, target_db
    plan = plans.plan(look, names, np.asarray(models.order), frame.depth.size, *limits, forms)
    if plan.form == plans.BLOCKS:
        plan = dataclasses.replace(plan, guides=plans.worth_reading(models, names))
    return plan, collected, models


def plan_of(frame: Frame, guides: Sequence[str] | None = None) -> plans.Plan:
    """The plan that method `auto` follows for a frame, with the time predicted of it."""
    names, inputs = prepare(frame, guides)
    return _planned(inputs, names, plans.seconds_per_pixel())[0]


def denoise_on_blocks(frame: Frame, guides: Sequence[str] | None = None) -> tuple[Array, Models]:
    """The smallest form by itself, with all guides: its light, and the models.

    frame, guides: as of `denoise`.
    """
    names, inputs = prepare(frame, guides)
    collected = _collect(inputs, names)
    models = fit(collected, _groups(inputs, names))
    image = _apply(inputs, collected, models, names, names, False)
    return image, models._replace(error=models.error * collected.unit**2)


@functools.partial(jax.jit, static_argnames="names")
def _collect(frame: Frame, names: tuple[str, ...]) -> Collected:
    images = flr_images(frame, names)
    return collect_frame(images["target"], images["guides"], images["weight"])


@functools.partial(jax.jit, static_argnames=("names", "used", "keep_energy"))
def _apply(
    frame: Frame,
    collected: Collected,
    models: Models,
    names: tuple[str, ...],
    used: tuple[str, ...],
    keep_energy: bool,
) -> jax.Array:
    """Evaluate the models at every pixel, reading the guides `used` out of `names` only."""
    images, groups = flr_images(frame, used), _groups(frame, names)
    starts = np.cumsum(groups) - groups
    kept = [
        start + i
        for name, start, size in zip(names, starts, groups, strict=True)
        if name in used
        for i in range(size)
    ]
    coefficients = hold(models.coefficients, collected, kept)
    none = jnp.zeros((*frame.normal.shape[:2], 0), coefficients.dtype)
    guides, shift = (*images["guides"], none), collected.shift[np.array(kept, int)]
    image = apply(coefficients, guides, shift, BLOCK) * collected.unit
    return rescale(image, light_of(images["target"]), images["weight"]) if keep_energy else image


def _groups(frame: Frame, names: Sequence[str]) -> tuple[int, ...]:
    """The channels of each guide, which enter a model together."""
    return tuple(getattr(frame, name).shape[-1] for name in names)
