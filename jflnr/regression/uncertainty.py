"""How far the result of adaptive FLR may be from the truth, without a reference."""

from __future__ import annotations

from collections.abc import Sequence

from jflnr.lazy import jax, jnp
from jflnr.regression.level import Fit, mean_guides, predict
from jflnr.regression.multiscale import Step
from jflnr.regression.resampling import double

# Fitted on train and val so that 90 % of the pixels are within 1.645 standard errors. Of the
# variance that the residuals tell: they are heavy-tailed, and neighbours share windows.
VARIANCE = 6.5
# Of the square of what the merge took for noise: some of it was signal.
LEFT_OUT = 0.4
# Of the square of the brightness: detail inside a block that no guide knows of.
DETAIL = 0.0054


def block_error(coarsest: Fit, steps: Sequence[Step]) -> jax.Array:
    """Expected squared error of the brightness at the finest blocks, `(h, w)`, but for `DETAIL`.

    It is made of the variance of what the models keep, and of the square of what the merge left
    out. The increments from level to level do not correlate, and of an increment with noise N of
    which the Wiener filter keeps a share, the expected squared error is share N.
    """
    variance, left_out = coarsest.variance, jnp.zeros_like(coarsest.variance)
    for step in steps:
        size, count = step.fine.variance.shape, step.merged.shape[0] - 1
        share = double(step.share, *size)
        noise = jnp.maximum(step.fine.variance - step.coarse.variance, 0)
        change = step.fine.coefficients - step.coarse.coefficients
        dropped = (1 - share) * predict(change, mean_guides(step.grid.moments, count))
        variance = double(variance, *size) + share * noise
        left_out = double(left_out, *size) + dropped**2
    return VARIANCE * variance + LEFT_OUT * left_out
