"""How far the result of adaptive FLR may be from the truth, without a reference."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jflnr.flr.adaptive import BLOCK, LEVELS, Fitted, fit_frame, image_of
from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.apply import apply
from jflnr.flr.level import mean_guides, predict
from jflnr.flr.moments import Guides
from jflnr.flr.pyramid import double

# Fitted on train and val so that 90 % of the pixels are within 1.645 standard errors. Of the
# variance that the residuals tell: they are heavy-tailed, and neighbours share windows.
VARIANCE = 6.5
# Of the square of what the merge took for noise: some of it was signal.
LEFT_OUT = 0.4
# Of the square of the brightness: detail inside a block that no guide knows of.
DETAIL = 0.0054


def flr_adaptive_with_error(
    target: jax.Array,
    guides: Guides,
    parameters: AdaptiveParameters,
    *,
    weight: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """The image of `flr_adaptive`, with the same arguments, and its standard error.

    Returns `(H, W, C)` and `(H, W, 1)`, the standard error of the image's brightness.
    """
    models = fit_frame(target, guides, parameters, BLOCK, LEVELS, weight)
    image = image_of(models, guides, parameters.numbers())
    constant = jnp.zeros((*image.shape[:2], 0), image.dtype)
    error = apply(_block_error(models)[None, None], constant, models.shift[:0], models.grid.block)
    return image * models.unit, error * models.unit


def _block_error(models: Fitted) -> jax.Array:
    """Standard error of the brightness at the finest blocks, `(h, w)`.

    The increments from level to level do not correlate, and of an increment with noise N of which
    the Wiener filter keeps a share, the expected squared error is share N.
    """
    variance, left_out = models.coarsest.variance, jnp.zeros_like(models.coarsest.variance)
    count = models.shift.size
    for step in models.steps:
        size = step.share.shape
        noise = jnp.maximum(step.fine.variance - step.coarse.variance, 0)
        change = step.fine.coefficients - step.coarse.coefficients
        dropped = (1 - step.share) * predict(change, mean_guides(step.grid.moments, count))
        variance = double(variance, *size) + step.share * noise
        left_out = double(left_out, *size) + dropped**2
    finest = mean_guides(models.grid.moments, count)
    level = predict(models.coefficients, finest)
    # The floor is there for its root's derivative, and for pixels that see no light.
    floor = 1e-6 * models.mean**2
    return jnp.sqrt(VARIANCE * variance + LEFT_OUT * left_out + DETAIL * level**2 + floor)
