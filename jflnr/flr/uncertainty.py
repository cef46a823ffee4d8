"""How far the result of adaptive FLR may be from the truth, without a reference."""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.flr.adaptive import BLOCK, LEVELS, Fitted, fit_frame, image_of
from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.apply import apply
from jflnr.flr.level import Fit, mean_guides, predict
from jflnr.flr.moments import Guides
from jflnr.flr.pyramid import double
from jflnr.flr.widths import Step

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


class Error(NamedTuple):
    """Parts of the expected squared error of the brightness, `(h, w)`: the variance of what the
    models keep, and the square of what the merge left out."""

    variance: jax.Array
    left_out: jax.Array

    @classmethod
    def of(cls, coarsest: Fit) -> Error:
        """That of the coarsest grid."""
        return cls(coarsest.variance, jnp.zeros_like(coarsest.variance))

    def after(self, step: Step) -> Error:
        """That of the next finer grid.

        The increments from level to level do not correlate, and of an increment with noise N of
        which the Wiener filter keeps a share, the expected squared error is share N.
        """
        size, count = step.share.shape, step.merged.shape[0] - 1
        noise = jnp.maximum(step.fine.variance - step.coarse.variance, 0)
        change = step.fine.coefficients - step.coarse.coefficients
        dropped = (1 - step.share) * predict(change, mean_guides(step.grid.moments, count))
        variance, left_out = (double(part, *size) for part in self)
        return Error(variance + step.share * noise, left_out + dropped**2)

    def square(self, level: jax.Array) -> jax.Array:
        """The expected squared error, `(h, w)`, of light of the brightness `level`."""
        return VARIANCE * self.variance + LEFT_OUT * self.left_out + DETAIL * level**2


def _block_error(models: Fitted) -> jax.Array:
    """Standard error of the brightness at the finest blocks, `(h, w)`."""
    error = functools.reduce(Error.after, models.steps, Error.of(models.coarsest))
    level = predict(models.coefficients, mean_guides(models.grid.moments, models.shift.size))
    # The floor is there for its root's derivative, and for pixels that see no light.
    return jnp.sqrt(error.square(level) + 1e-6 * models.mean**2)
