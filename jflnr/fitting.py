"""Learning sigma, eps and eps' on frames with a reference, by gradient through the denoiser."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import jaxopt

from jflnr import checks
from jflnr import guides as guide_layers
from jflnr.denoising import BLOCK
from jflnr.flr.apply import apply
from jflnr.flr.blur import blur
from jflnr.flr.moments import centre, collect
from jflnr.flr.parameters import DEFAULT, Parameters
from jflnr.flr.solve import solve
from jflnr.frame import Frame

# How far the window reaches while it is fitted, pixels: three times the widest worth having.
SUPPORT = 96


class Example(NamedTuple):
    """One frame as fitting sees it: what does not depend on the parameters is done once."""

    moments: jax.Array  # (K, h, w), not blurred
    shift: jax.Array  # (Q,)
    guides: tuple[jax.Array, ...]  # (H, W, C) each
    albedo: jax.Array  # (H, W, 3)
    reference: jax.Array  # (H, W, 3), demodulated


class Fit(NamedTuple):
    """Fitted parameters, and the mean SMAPE over the frames before and after."""

    parameters: Parameters
    before: float
    after: float
    steps: int


def fit(
    frames: Sequence[Frame],
    *,
    guides: Sequence[str] | None = None,
    block: int = BLOCK,
    initial: Parameters = DEFAULT,
    steps: int = 80,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Minimise the mean SMAPE of the reflected light against the references with L-BFGS.

    frames: with a reference each; they may differ in size. guides: as for `denoise`; all frames
    must have them. progress: called with the step and the mean SMAPE after each step.

    Raises `ValueError` if there is no frame, or one without a reference or a guide.
    """
    checks.positive_integer("block", block)
    checks.positive_integer("steps", steps)
    if not frames:
        raise ValueError("frames is empty; fitting needs at least one frame with a reference")
    names = guide_layers.choose(frames[0], guides)
    examples = [_example(frame, guide_layers.choose(frame, names), block) for frame in frames]

    def mean_smape(parameters: Parameters) -> tuple[jax.Array, Parameters]:
        # One frame at a time: memory for one, and one program for all frames of a size.
        losses = [_smape_and_gradient(example, parameters, block) for example in examples]
        return jax.tree.map(lambda *values: sum(values) / len(values), *losses)

    solver = jaxopt.LBFGS(
        mean_smape, value_and_grad=True, jit=False, linesearch="backtracking", maxls=6, tol=1e-4
    )
    parameters = jax.tree.map(jnp.asarray, initial)
    state = solver.init_state(parameters)
    before = float(state.value)
    step = 0
    while step < steps and state.error > solver.tol:
        parameters, state = solver.update(parameters, state)
        step += 1
        if progress is not None:
            progress(step, float(state.value))
    return Fit(parameters, before, float(state.value), step)


def _example(frame: Frame, names: tuple[str, ...], block: int) -> Example:
    if frame.reference is None:
        raise ValueError("frames: every frame needs a reference to be fitted to")
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


def _smape_and_gradient(
    example: Example, parameters: Parameters, block: int
) -> tuple[jax.Array, Parameters]:
    return _value_and_grad(parameters, example, block)
