"""How far the result of adaptive FLR may be from the truth, without a reference."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jflnr.regression.level import Fit, mean_guides, predict
from jflnr.regression.pyramid import double
from jflnr.regression.widths import Step

# Fitted on train and val so that 90 % of the pixels are within 1.645 standard errors. Of the
# variance that the residuals tell: they are heavy-tailed, and neighbours share windows.
VARIANCE = 6.5
# Of the square of what the merge took for noise: some of it was signal.
LEFT_OUT = 0.4
# Of the square of the brightness: detail inside a block that no guide knows of.
DETAIL = 0.0054


def block_error(coarsest: Fit, steps: list[Step], guides: int) -> jax.Array:
    """Expected squared error of the brightness at the finest blocks, `(h, w)`, without what is
    inside them (`DETAIL`).

    The increments from level to level do not correlate, and of an increment with noise N of which
    the Wiener filter keeps a share, the expected squared error is share N.
    """
    variance, left_out = coarsest.variance, jnp.zeros_like(coarsest.variance)
    for step in steps:
        size = step.share.shape
        noise = jnp.maximum(step.fine.variance - step.coarse.variance, 0)
        change = step.fine.coefficients - step.coarse.coefficients
        dropped = (1 - step.share) * predict(change, mean_guides(step.grid.moments, guides))
        variance = double(variance, *size) + step.share * noise
        left_out = double(left_out, *size) + dropped**2
    return VARIANCE * variance + LEFT_OUT * left_out
