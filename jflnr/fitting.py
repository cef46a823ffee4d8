"""Learning the numbers of FLR or adaptive FLR on frames with a reference, by gradient through the
whole denoiser."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jaxopt
import numpy as np
from jaxopt.tree_util import tree_l2_norm

from jflnr import checks
from jflnr import guides as guide_layers
from jflnr.denoising import BLOCK
from jflnr.flnr.loss import shown_error
from jflnr.flr.adaptive import flr_adaptive
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.flr.apply import apply
from jflnr.flr.blur import blur
from jflnr.flr.moments import centre, collect
from jflnr.flr.parameters import DEFAULT, Parameters
from jflnr.flr.solve import solve
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images, frame_inputs
from jflnr.metrics import exposure

METHODS = ("flr", "flr-adaptive")
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
    """One frame as fitting FLR sees it: what does not depend on the parameters is done once."""

    moments: jax.Array  # (K, h, w), not blurred
    shift: jax.Array  # (Q,)
    guides: tuple[jax.Array, ...]  # (H, W, C) each
    albedo: jax.Array  # (H, W, 3)
    reference: jax.Array  # (H, W, 3), demodulated


class AdaptiveExample(NamedTuple):
    """One frame as fitting adaptive FLR sees it. images: arguments of `flr_adaptive`. albedo:
    `(H, W, 3)`, times the exposure. target: `(H, W, 3)`, the reflected light as exposed."""

    images: dict[str, Any]
    albedo: Array
    target: Array


class Fit(NamedTuple):
    """Fitted parameters, and the mean loss over the frames before and after."""

    parameters: Parameters | AdaptiveParameters
    before: float
    after: float
    steps: int


def fit(
    frames: Sequence[Frame],
    method: str = "flr",
    *,
    guides: Sequence[str] | None = None,
    block: int = BLOCK,
    initial: Parameters | AdaptiveParameters | None = None,
    steps: int = 80,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Minimise the mean error of the reflected light against the references with L-BFGS.

    The error is SMAPE for `flr`; for `flr-adaptive`, which one setting has to serve at all sample
    counts, the one that FLNR is trained with (`jflnr.flnr.loss.shown_error`).

    frames: with a reference each; they may differ in size. method: one of `METHODS`. guides: as for
    `denoise`; all frames must have them. block: of `flr`. initial: where to start; the defaults if
    None. progress: called with the step and the mean error after each step.

    Raises `ValueError` if there is no frame, or one without a reference or a guide.
    """
    checks.choice("method", method, METHODS)
    checks.positive_integer("block", block)
    checks.positive_integer("steps", steps)
    if not frames:
        raise ValueError("frames is empty; fitting needs at least one frame with a reference")
    if any(frame.reference is None for frame in frames):
        raise ValueError("frames: every frame needs a reference to be fitted to")
    names = guide_layers.choose(frames[0], guides)
    examples: list[Any]
    if method == "flr":
        examples = [_example(frame, guide_layers.choose(frame, names), block) for frame in frames]
        one = lambda parameters, example: _value_and_grad(parameters, example, block)
    else:
        examples = [_adaptive(frame, guide_layers.choose(frame, names)) for frame in frames]
        one = _adaptive_value_and_grad

    values: list[float] = []

    def mean_loss(parameters: Any) -> tuple[jax.Array, Any]:
        # One frame at a time: memory for one, and one program for all frames of a size.
        losses = [one(parameters, example) for example in examples]
        mean = jax.tree.map(lambda *some: sum(some) / len(some), *losses)
        values.append(float(mean[0]))
        return mean

    done = itertools.count(1)
    # SciPy's search along lines never ends above its start, as `jaxopt.LBFGS` did here.
    solver = jaxopt.ScipyMinimize(
        fun=mean_loss,
        value_and_grad=True,
        jit=False,
        method="L-BFGS-B",
        maxiter=steps,
        callback=lambda _: progress(next(done), min(values)) if progress else None,
    )
    start = (DEFAULT if method == "flr" else ADAPTIVE_DEFAULT) if initial is None else initial
    parameters, info = solver.run(jax.tree.map(jnp.float32, start))
    return Fit(parameters, values[0], float(info.fun_val), int(info.iter_num))


def _example(frame: Frame, names: tuple[str, ...], block: int) -> Example:
    layers = guide_layers.layers(frame, names)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0] > 0
    shift = centre(layers, weight)
    return Example(
        moments=collect(jnp.asarray(frame.indirect), layers, shift, block, weight),
        shift=shift,
        guides=layers,
        albedo=jnp.asarray(frame.albedo),
        reference=jnp.asarray(frame.reference),
    )


@jax.jit
def smape(picture: jax.Array, reference: jax.Array) -> jax.Array:
    """Mean of |x - y| / (|x| + |y|), differentiable where both are 0."""
    # Its square must not vanish where the reference is black, or the derivative there is 0/0.
    floor = jnp.maximum(1e-3 * jnp.mean(reference), 1e-12)
    return jnp.mean(jnp.abs(picture - reference) / (jnp.abs(picture) + reference + floor))


def _loss(parameters: Parameters, example: Example, block: int) -> jax.Array:
    channels = example.reference.shape[-1]
    moments = blur(example.moments, parameters.sigma / block, reach=-(-SUPPORT // block))
    coefficients = solve(moments, example.shift, parameters, channels)
    light = apply(coefficients, example.guides, example.shift, block)
    return smape(example.albedo * light, example.albedo * example.reference)


_value_and_grad = jax.jit(jax.value_and_grad(_loss), static_argnames="block")


def _adaptive(frame: Frame, names: tuple[str, ...]) -> AdaptiveExample:
    albedo, reference = np.asarray(frame.albedo), np.asarray(frame.reference)
    scale = np.float32(exposure(albedo * reference))
    top, left = max(len(albedo) - HEIGHT, 0) // 2, max(albedo.shape[1] - WIDTH, 0) // 2
    cut = lambda layer: np.asarray(layer)[top : top + HEIGHT, left : left + WIDTH]
    shown = scale * cut(albedo)
    middle = jax.tree.map(cut, frame_inputs(frame, names))
    images = jax.tree.map(np.asarray, adaptive_images(middle, names))
    return AdaptiveExample(images, shown, np.clip(shown * cut(reference), 0, BRIGHTEST))


def _adaptive_loss(parameters: AdaptiveParameters, example: AdaptiveExample) -> jax.Array:
    images = example.images
    light = flr_adaptive(images["target"], images["guides"], parameters, weight=images["weight"])
    return shown_error(light * example.albedo, jnp.asarray(example.target))


@jax.jit
def _adaptive_value_and_grad(
    parameters: AdaptiveParameters, example: AdaptiveExample
) -> tuple[jax.Array, AdaptiveParameters]:
    value, slope = jax.value_and_grad(_adaptive_loss)(parameters, example)
    factor = jnp.minimum(1, LONGEST / jnp.maximum(tree_l2_norm(slope), 1e-12))
    return value, jax.tree.map(lambda component: factor * component, slope)
