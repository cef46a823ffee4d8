"""`jflnr.select` and the method `auto` of `jflnr.denoise`."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.auto import plan as plans
from jflnr.auto.blocks import Models, Unfinished, fit, refine
from jflnr.auto.collected import Collected, collect_frame, hold
from jflnr.auto.complexity import is_simple
from jflnr.auto.weights import SETTINGS
from jflnr.checks import one_sentence
from jflnr.frame import Array, Frame
from jflnr.images import guides as guide_layers
from jflnr.images.inputs import plain_images, prepare, robust_images, same_size
from jflnr.images.noisy_guides import Filters
from jflnr.methods import method_of
from jflnr.network.flnr import GUIDES, NEEDED
from jflnr.regression.adaptive import light_of
from jflnr.regression.apply import apply
from jflnr.regression.energy import rescale
from jflnr.regression.floor import with_own_light
from jflnr.stages import on_frame


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Auto:
    """No more model than a frame needs (docs/select.md).

    budget_ms: time that denoising may take, by prediction; the first frame measures the device, in
    a second or two. target_db: PSNR to be reached, by prediction, as cheaply as possible.
    keep_energy: keep the mean radiance exactly.
    """

    name: ClassVar[str] = "auto"
    backends: ClassVar[tuple[str, ...]] = ("jax",)

    budget_ms: float | None = field(default=None, metadata={"static": True})
    target_db: float | None = field(default=None, metadata={"static": True})
    keep_energy: bool = field(default=False, metadata={"static": True})

    def __post_init__(self) -> None:
        for name in ("budget_ms", "target_db"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; it must be a positive number")

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> Auto:
        same_size(frame, self.name)
        return self

    def denoise(self, frame: Frame, names: tuple[str, ...]) -> Array:
        """The light `(H, W, C)` by the smallest model that is good enough."""
        return self.select(frame, names)[1]

    def select(self, frame: Frame, names: tuple[str, ...]) -> tuple[plans.Plan, Array]:
        """The plan for a frame, and its light."""
        wishes = self.budget_ms is not None or self.target_db is not None
        seconds = plans.seconds_per_pixel() if wishes else None
        limits = plans.Limits(self.budget_ms, self.target_db, seconds)
        frame = _on_device(frame)
        plan, fitted = _planned(frame, names, limits)
        if plan.form not in plans.BLOCKS:
            method = method_of(plan.form, keep_energy=self.keep_energy).for_frame(frame, names)
            return plan, on_frame(method, frame, names)["image"]
        if plans.COLLECTED[plan.form] != fitted.block:
            fitted = _fitted(frame, names, plan.form)
        models = _finished(fitted, plan.form)
        plan = dataclasses.replace(plan, guides=plans.worth_reading(models, names))
        used = tuple(names.index(name) for name in plan.guides)
        return plan, _image(fitted, models, used, self.keep_energy)


@one_sentence
def select(
    frame: Frame,
    budget_ms: float | None = None,
    target_db: float | None = None,
    *,
    guides: Sequence[str] | None = None,
) -> tuple[plans.Plan, Array]:
    """Denoise a frame with the smallest model that is good enough for it (docs/select.md).

    frame, guides: as of `denoise`. budget_ms, target_db: as of `Auto`.
    Returns the plan, with predicted error and time, and the light, `(H, W, C)`.

    Raises `ValueError` or `TypeError` as `denoise` does, and for a budget that is not positive.
    """
    method = Auto(budget_ms, target_db)
    names, inputs = prepare(frame, guides, method)
    return method.for_frame(inputs, names).select(inputs, names)


def plan_of(frame: Frame, guides: Sequence[str] | None = None) -> plans.Plan:
    """The plan that method `auto` follows for a frame, with the time predicted of it."""
    names, inputs = prepare(frame, guides, Auto())
    limits = plans.Limits(seconds=plans.seconds_per_pixel())
    return _planned(_on_device(inputs), names, limits)[0]


def denoise_on_blocks(frame: Frame, form: str) -> tuple[Array, Models]:
    """One of the forms of `BLOCKS` by itself, with all guides: its light, and the models.

    frame: as of `denoise`. The errors of the models are in the unit of the light.
    """
    names, inputs = prepare(frame, None, Auto())
    fitted = _fitted(_on_device(inputs), names, form)
    models = _finished(fitted, form)
    image = _image(fitted, models, tuple(range(len(names))))
    return image, models._replace(error=models.error * fitted.collected.unit**2)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Fitted:
    """A frame on the device, its ambient occlusion without noise if models follow that closely,
    its moments on blocks of so many pixels, and models."""

    frame: Frame
    scene: guide_layers.Scene
    collected: Collected
    models: Models
    unfinished: Unfinished
    names: tuple[str, ...] = field(metadata={"static": True})
    groups: tuple[int, ...] = field(metadata={"static": True})
    block: int = field(metadata={"static": True})


_on_device = functools.partial(jax.tree.map, jnp.asarray)


def _planned(
    frame: Frame, names: tuple[str, ...], limits: plans.Limits
) -> tuple[plans.Plan, Fitted]:
    """The plan, and the models of the form that it rests on."""
    pixels = frame.depth.size
    first = plans.first(bool(is_simple(frame)), limits, pixels)
    fitted = _fitted(frame, names, first)
    statistics = plans.statistics_of(fitted.models)
    network = set(names) in (set(NEEDED), set(GUIDES)) and frame.indirect.shape[-1] % 3 == 0
    order = np.asarray(fitted.models.order)
    return plans.plan(first, statistics, names, order, pixels, limits, network), fitted


def _fitted(frame: Frame, names: tuple[str, ...], form: str) -> Fitted:
    """The models of the form that `form` begins with; the frame is on the device."""
    block = plans.COLLECTED[form]
    scene, ao, collected = _collect(frame, names, block)
    frame = dataclasses.replace(frame, ao=frame.ao if ao is None else ao)
    groups = tuple(getattr(frame, name).shape[-1] for name in names)
    models, unfinished = fit(collected, groups, block)
    return Fitted(frame, scene, collected, models, unfinished, names, groups, block)


def _finished(fitted: Fitted, form: str) -> Models:
    """The models of a form: those it began with, or whole ones of the blocks collected."""
    if form == plans.start_of(form):
        return fitted.models
    return refine(fitted.collected, fitted.unfinished, fitted.groups, fitted.block)


@functools.partial(jax.jit, static_argnames=("names", "block"))
def _collect(
    frame: Frame, names: tuple[str, ...], block: int
) -> tuple[guide_layers.Scene, jax.Array | None, Collected]:
    """The scene, its smoothed ambient occlusion if that is used, and the moments.

    No layer of the frame itself: a program that returned one would copy it.
    """
    scene = guide_layers.scene_of(frame)
    prepared = robust_images if _is_fine(block) else plain_images
    images = prepared(frame, names, scene)
    collected = collect_frame(images["target"], images["guides"], block, images["weight"])
    smoothed = "ao" in names and _is_fine(block)
    return scene, images["guides"][names.index("ao")] if smoothed else None, collected


def _is_fine(block: int) -> bool:
    """Whether blocks are so small that models follow the noise of ambient occlusion, and need a
    floor. Scenes that large ones are enough for have few gaps and corners to be too dark in."""
    return block < 8


@functools.partial(jax.jit, static_argnames=("used", "keep_energy"))
def _image(
    fitted: Fitted, models: Models, used: tuple[int, ...], keep_energy: bool = False
) -> jax.Array:
    """Evaluate the models at every pixel, reading the guides `used` only."""
    block, collected = fitted.block, fitted.collected
    prepared = robust_images if _is_fine(block) else plain_images
    images = prepared(fitted.frame, fitted.names, fitted.scene, Filters(lambda ao, *_: ao))
    target, layers = images["target"], images["guides"]
    ends = np.cumsum([layer.shape[-1] for layer in layers])
    kept = [int(q) for n in used for q in range(ends[n] - layers[n].shape[-1], ends[n])]
    held = hold(models.coefficients, models.means, kept)
    guides = (*(layers[n] for n in used), jnp.zeros((*target.shape[:2], 0), held.dtype))
    shift = collected.shift[np.array(kept, int)]
    if _is_fine(block):
        held = with_own_light(held, models.means[np.array([0, *(q + 1 for q in kept)])])
        image = apply(held, guides, shift, block, SETTINGS.floor) * collected.unit
    else:
        image = apply(held * collected.unit, guides, shift, block)
    return rescale(image, light_of(target), images["weight"]) if keep_energy else image
