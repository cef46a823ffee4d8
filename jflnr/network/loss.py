"""What training minimises: the error of what is shown, and SMAPE of the radiance."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jflnr.metrics import GAMMA
from jflnr.network import unet
from jflnr.network.examples import Example
from jflnr.network.flnr import FLNR
from jflnr.stages import Known, Parts, run

# Mean squared error of a picture that is as good as its reference, whose noise is not ours to fit.
FLOOR = 3e-4
# Weight of SMAPE against decibels.
SMAPE = 5.0
DARKEST = 1e-3


def light(params: unet.Params, parts: Parts, known: Known) -> jax.Array:
    """The denoised light, `(H, W, 3)`, from what precedes the network."""
    method = FLNR(params=params)
    return run(method.with_network(), method, parts, known)[0]["image"]


def to_reference(params: unet.Params, example: Example) -> jax.Array:
    """For a target without noise: `shown_error`."""
    picture = light(params, example.parts, example.known) * example.albedo * example.exposure
    return shown_error(picture, example.target)


def shown_error(picture: jax.Array, target: jax.Array) -> jax.Array:
    """Mean squared error of the displayed picture in decibels, plus SMAPE times `SMAPE`.

    Decibels, since PSNR is what pictures are judged by: every frame counts alike.
    picture, target: `(H, W, 3)`, reflected light as exposed.
    """
    error = jnp.mean((_shown(picture) - _shown(jnp.minimum(target, 1))) ** 2)
    smape = jnp.mean(jnp.abs(picture - target) / (jnp.abs(picture) + target + 0.01))
    return 10 * jnp.log10(error + FLOOR) + SMAPE * smape


def to_noisy(params: unet.Params, example: Example) -> jax.Array:
    """For a target with noise of its own: `relative`."""
    target = example.target
    picture = light(params, example.parts, example.known) * example.albedo * example.exposure
    return relative(picture, target)


def relative(picture: jax.Array, target: jax.Array) -> jax.Array:
    """Squared error relative to the squared output.

    With the denominator left out of the derivative the minimum is at the target's mean, so other
    noise of the same frame serves as well as its reference (Lehtinen et al. 2018, section 3.3).
    """
    scale = jax.lax.stop_gradient(jnp.maximum(picture, 0) + 0.05) ** 2
    return jnp.mean((picture - target) ** 2 / scale)


def _shown(picture: jax.Array) -> jax.Array:
    """`metrics.display`, with a slope in the dark and a small one beyond white."""
    picture = jnp.maximum(picture, 0)
    dark = DARKEST ** (1 / GAMMA) * picture / DARKEST
    curve = jnp.where(picture > DARKEST, jnp.maximum(picture, DARKEST) ** (1 / GAMMA), dark)
    return jnp.where(curve < 1, curve, 1 + 0.02 * (curve - 1))
