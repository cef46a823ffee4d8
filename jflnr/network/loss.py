"""What training minimises: errors of the picture as it is displayed."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp

from jflnr.metrics import GAMMA
from jflnr.network import flnr, unet
from jflnr.network.examples import LEAST_ERROR, Example

# Weight of SMAPE against decibels, and beyond white of logarithms against what is shown: what is
# brighter than white is to keep its light, or other exposures would be wrong.
SMAPE, BEYOND = 5.0, 0.25
DARKEST = 1e-3
# Weight of the squared relative error of a crop's light, since medians are darker than means.
ENERGY = 5.0


def relative_error(params: unet.Params, example: Example) -> jax.Array:
    """Squared error of the displayed picture, over that before the network on the whole frame.

    So every frame and every count of samples says about as much. And the crop is to be as bright as
    its target on the mean.
    """
    picture = example.albedo * example.read.corrected(flnr.said(params, example.read))
    picture, target = picture * example.exposure, example.albedo * example.target
    bright = functools.partial(_shown, beyond=lambda curve: BEYOND * jnp.log(curve))
    difference = bright(picture) - bright(target)
    brighter = jnp.mean(picture - target) / (jnp.mean(target) + DARKEST)
    return jnp.mean(difference**2) / example.error + ENERGY * jnp.minimum(brighter**2, 1)


def shown_error(picture: jax.Array, target: jax.Array) -> jax.Array:
    """Mean squared error of the displayed picture in decibels, plus SMAPE times `SMAPE`.

    Decibels, since PSNR is what pictures are judged by: every frame counts alike.
    picture, target: `(H, W, 3)`, reflected light as exposed.
    """
    smape = jnp.mean(jnp.abs(picture - target) / (jnp.abs(picture) + target + 0.01))
    shown = functools.partial(_shown, beyond=lambda curve: 0.02 * (curve - 1))
    error = jnp.mean((shown(picture) - shown(jnp.minimum(target, 1))) ** 2)
    return 10 * jnp.log10(error + LEAST_ERROR) + SMAPE * smape


def _shown(picture: jax.Array, beyond: Callable[[jax.Array], jax.Array]) -> jax.Array:
    """`metrics.display`, with a slope in the dark. beyond: what the curve adds beyond white."""
    picture = jnp.maximum(picture, 0)
    dark = DARKEST ** (1 / GAMMA) * picture / DARKEST
    curve = jnp.where(picture > DARKEST, jnp.maximum(picture, DARKEST) ** (1 / GAMMA), dark)
    return jnp.where(curve < 1, curve, 1 + beyond(jnp.maximum(curve, 1)))
