"""Learning the numbers of FLR or adaptive FLR on frames with a reference, by gradient through the
whole denoiser."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jaxopt
import numpy as np

from jflnr import checks
from jflnr.frame import Array, Frame
from jflnr.images.guides import choose
from jflnr.images.inputs import frame_inputs
from jflnr.methods import method_of
from jflnr.metrics import exposure
from jflnr.network.loss import shown_error
from jflnr.parameters import METHODS
from jflnr.regression.flr import FLR
from jflnr.stages import Known, Parts, regress, run

# How far the window of FLR reaches while it is fitted, pixels: three times the widest worth having.
SUPPORT = 96
# Of larger frames adaptive FLR is fitted to the middle: its derivative keeps all steps in memory.
HEIGHT, WIDTH = 360, 640
# Where a threshold is nearly crossed one frame's derivative may be thousands of times that of
# others, and does not tell what a whole step changes. So none is longer; most are near 1.
LONGEST = 5.0
# Light that is brighter than this, as exposed, is white however bright it is.
BRIGHTEST = 1e4


class Example(NamedTuple):
    """One frame as fitting sees it. parts, known: what does not depend on the numbers, done once.
    albedo: `(H, W, 3)`. target: `(H, W, 3)`, the reflected light."""

    parts: Parts
    known: Known
    albedo: Array
    target: Array


class Fit(NamedTuple):
    """The method with fitted numbers, and the mean loss over the frames before and after."""

    method: Any
    before: float
    after: float
    steps: int


def fit(
    frames: Sequence[Frame],
    method: Any = "flr",
    *,
    guides: Sequence[str] | None = None,
    steps: int = 80,
    progress: Callable[[int, float], None] | None = None,
    **options: Any,
) -> Fit:
    """Minimise the mean error of the reflected light against the references with L-BFGS.

    The error is SMAPE for `flr`; for `flr-adaptive`, which one setting has to serve at all sample
    counts, decibels of the displayed picture (`jflnr.network.loss.shown_error`).

    frames: with a reference each; they may differ in size. method: `flr`, `flr-adaptive` or one of
    these as an object, whose numbers are where to start. guides: as for `denoise`; all frames must
    have them. progress: called with the step and the mean error after each step. options: fields of
    the method to replace.

    Raises `ValueError` if there is no frame, or one without a reference or a guide.
    """
    method = method_of(method, **options)
    checks.choice("method", method.name, METHODS)
    checks.positive_integer("steps", steps)
    if not frames:
        raise ValueError("frames is empty; fitting needs at least one frame with a reference")
    if any(frame.reference is None for frame in frames):
        raise ValueError("frames: every frame needs a reference to be fitted to")
    names = choose(frames[0], guides)
    prepare = _adaptive
    if isinstance(method, FLR):
        prepare, method = _plain, dataclasses.replace(method, support=SUPPORT)
    examples = [prepare(method, frame, choose(frame, names)) for frame in frames]
    values: list[float] = []

    def mean_loss(logarithms: jax.Array) -> tuple[jax.Array, jax.Array]:
        # One frame at a time: memory for one, and one program for all frames of a size.
        losses = [_value_and_grad(method, logarithms, example) for example in examples]
        value, slope = (sum(some) / len(some) for some in zip(*losses, strict=True))
        values.append(float(value))
        return value, slope

    done = itertools.count(1)
    # Its search along lines never ends above its start, unlike that of `jaxopt.LBFGS`.
    solver = jaxopt.ScipyMinimize(
        fun=mean_loss,
        value_and_grad=True,
        jit=False,
        method="L-BFGS-B",
        maxiter=steps,
        callback=lambda _: progress(next(done), min(values)) if progress else None,
    )
    # Every real value of a logarithm is a valid model.
    logarithms, info = solver.run(jnp.log(jnp.float32(jax.tree.leaves(method))))
    fitted = jax.tree.map(float, _with(method, logarithms))
    if isinstance(fitted, FLR):
        fitted = dataclasses.replace(fitted, support=None)
    return Fit(fitted, values[0], float(info.fun_val), int(info.iter_num))


def _with(method: Any, logarithms: jax.Array) -> Any:
    """The method with the numbers of these logarithms, `(n,)`."""
    return jax.tree.unflatten(jax.tree.structure(method), list(jnp.exp(logarithms)))


def _plain(method: FLR, frame: Frame, names: tuple[str, ...]) -> Example:
    images = jax.tree.map(jnp.asarray, method.images(frame_inputs(frame, names), names))
    collect, *_ = method.stages()
    parts, known = run([collect], method, images, method.known(images))
    albedo = jnp.asarray(frame.albedo)
    return Example(parts, known, albedo, albedo * jnp.asarray(frame.reference))


@jax.jit
def smape(picture: jax.Array, reference: jax.Array) -> jax.Array:
    """Mean of |x - y| / (|x| + |y|), differentiable where both are 0."""
    # Its square must not vanish where the reference is black, or the derivative there is 0/0.
    epsilon = jnp.maximum(1e-3 * jnp.mean(reference), 1e-12)
    return jnp.mean(jnp.abs(picture - reference) / (jnp.abs(picture) + reference + epsilon))


def _loss(method: FLR, logarithms: jax.Array, example: Example) -> jax.Array:
    method = _with(method, logarithms)
    parts, _ = run(method.stages()[1:], method, example.parts, example.known)
    return smape(example.albedo * parts["image"], example.target)


def _adaptive(method: Any, frame: Frame, names: tuple[str, ...]) -> Example:
    albedo, reference = np.asarray(frame.albedo), np.asarray(frame.reference)
    scale = np.float32(exposure(albedo * reference))
    top, left = max(len(albedo) - HEIGHT, 0) // 2, max(albedo.shape[1] - WIDTH, 0) // 2
    cut = lambda layer: np.asarray(layer)[top : top + HEIGHT, left : left + WIDTH]
    shown = scale * cut(albedo)
    middle = jax.tree.map(cut, frame_inputs(frame, names))
    images = jax.tree.map(np.asarray, method.images(middle, names))
    return Example(images, {}, shown, np.clip(shown * cut(reference), 0, BRIGHTEST))


def _adaptive_loss(method: Any, logarithms: jax.Array, example: Example) -> jax.Array:
    light = regress(_with(method, logarithms), example.parts)["image"]
    return shown_error(light * example.albedo, jnp.asarray(example.target))


@jax.jit
def _value_and_grad(
    method: Any, logarithms: jax.Array, example: Example
) -> tuple[jax.Array, jax.Array]:
    if isinstance(method, FLR):
        return jax.value_and_grad(_loss, argnums=1)(method, logarithms, example)
    value, slope = jax.value_and_grad(_adaptive_loss, argnums=1)(method, logarithms, example)
    return value, slope * jnp.minimum(1, LONGEST / jnp.maximum(jnp.linalg.norm(slope), 1e-12))
