"""Finer and coarser models put together by how much of their difference is signal."""

from __future__ import annotations

from jflnr.lazy import jax, jnp
from jflnr.regression.division import divide
from jflnr.regression.level import Fit, Grid, mean_guides, predict
from jflnr.regression.resampling import halve
from jflnr.regression.window import gather


def signal_share(
    grid: Grid, fine: Fit, coarse: Fit, reference: jax.Array, caution: jax.Array | float
) -> jax.Array:
    """The share of signal in the difference d between two levels, in [0, 1], on the coarser grid.

    If the coarser window were unbiased it would be the efficient estimate, and the variance of d
    would be the difference N of the two variances (Hausman 1978). What mean(d^2) over the
    neighbourhood has beyond N is signal, and the Wiener filter keeps that share of d. Increments
    of nested efficient estimates do not correlate, so each level is judged by itself.

    grid, fine: the finer level. coarse: the coarser one, interpolated to the finer grid but for its
    window, over which d^2 and N are averaged. reference: `(h, w)`, a squared brightness that both
    are relative to. caution: factor on N.
    """
    regressors = mean_guides(grid.moments, fine.coefficients.shape[0] - 1)
    difference = predict(fine.coefficients - coarse.coefficients, regressors)
    noise = jnp.maximum(fine.variance - coarse.variance, 0)
    there = (grid.moments[0] > 1e-12).astype(reference.dtype)
    planes = jnp.stack([difference**2 / reference, noise / reference, jnp.ones_like(noise)])
    power, noise, count = gather(halve(planes * there), coarse.window)
    # Means: far from all light the squares of sums, in the derivative, are too small for float32.
    inverse = divide(1, count, 1e-12)
    power, noise = power * inverse, noise * inverse
    return jnp.maximum(power - caution * noise, 0) / jnp.maximum(power, 1e-9)
