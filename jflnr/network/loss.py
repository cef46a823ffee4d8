"""What training minimises: errors of the picture as it is displayed."""

import jax
import jax.numpy as jnp

from jflnr.metrics import GAMMA
from jflnr.network import flnr, unet
from jflnr.network.examples import LEAST_ERROR, Example

# Weight of SMAPE against decibels.
SMAPE = 5.0
DARKEST = 1e-3


def relative_error(params: unet.Params, example: Example) -> jax.Array:
    """Squared error of the displayed picture, over that of adaptive FLR on the whole frame.

    So every frame and every count of samples says about as much.
    """
    light = example.read.light * flnr.gains(params, example.read)
    picture = example.albedo * light * example.exposure
    return _error(picture, example.albedo * example.target) / example.error


def shown_error(picture: jax.Array, target: jax.Array) -> jax.Array:
    """Mean squared error of the displayed picture in decibels, plus SMAPE times `SMAPE`.

    Decibels, since PSNR is what pictures are judged by: every frame counts alike.
    picture, target: `(H, W, 3)`, reflected light as exposed.
    """
    smape = jnp.mean(jnp.abs(picture - target) / (jnp.abs(picture) + target + 0.01))
    return 10 * jnp.log10(_error(picture, target) + LEAST_ERROR) + SMAPE * smape


def _error(picture: jax.Array, target: jax.Array) -> jax.Array:
    return jnp.mean((_shown(picture) - _shown(jnp.minimum(target, 1))) ** 2)


def _shown(picture: jax.Array) -> jax.Array:
    """`metrics.display`, with a slope in the dark and a small one beyond white."""
    picture = jnp.maximum(picture, 0)
    dark = DARKEST ** (1 / GAMMA) * picture / DARKEST
    curve = jnp.where(picture > DARKEST, jnp.maximum(picture, DARKEST) ** (1 / GAMMA), dark)
    return jnp.where(curve < 1, curve, 1 + 0.02 * (curve - 1))
