"""Widths from the data: a fit on every grid, and of each finer one as much as is signal."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from jflnr.lazy import jax, jnp
from jflnr.regression.level import Fit, Grid, fit_level, guide_features, mean_guides, predict
from jflnr.regression.merge import signal_share
from jflnr.regression.moments import channels_of
from jflnr.regression.resampling import double, double_all, halve_inside
from jflnr.stages import Known

if TYPE_CHECKING:
    from jflnr.regression.adaptive import AdaptiveFLR


# Side of the tiles that are refined or not, in blocks of the finest grid.
TILE = 8


class Step(NamedTuple):
    """One level finer than what was known before.

    fine: its fit. coarse: that of the coarser level, on this grid. share: on the coarser grid, how
    much of their difference is signal. merged: models `(Q + 1, C, h, w)` with that share added.
    """

    grid: Grid
    fine: Fit
    coarse: Fit
    share: jax.Array
    merged: jax.Array


def fit_levels(numbers: AdaptiveFLR, moments: jax.Array, known: Known) -> tuple[Fit, list[Step]]:
    """The fit of the coarsest grid, and the steps from there to the finest.

    moments: weighted, of the finest blocks, and as the last plane their noise.
    """
    shift, mean = known["shift"], known["mean"]
    finest = Grid(moments[:-1], moments[-1:], numbers.finest)
    channels = channels_of(finest.moments, shift.size)
    *finer, coarsest = finest.pyramid(numbers.levels)
    first = fit_level(coarsest, shift, channels, mean, numbers)
    coarse, merged, steps = first, first.coefficients, list[Step]()
    for grid in reversed(finer):
        size = grid.moments.shape[1:]
        so_far = coarse.coefficients, merged, coarse.variance
        coefficients, merged, variance = double_all(so_far, *size)
        coarse = Fit(coefficients, variance, coarse.window)
        luminance = jnp.maximum(predict(merged, mean_guides(grid.moments, shift.size)), 0)
        # Windows end where what is known so far of the brightness changes.
        edge = numbers.brightness_scale * jnp.log(luminance / mean + 0.1)
        features = jnp.concatenate([guide_features(grid, shift.size, numbers), edge[None]])
        # Windows of the finest blocks are so narrow that slopes across them are hardly worth
        # their time.
        fine = fit_level(grid, shift, channels, mean, numbers, features, slopes=grid is not finest)
        if grid is finest and steps and numbers.worth is not None:
            where = chosen(steps[-1].share, numbers.worth, *size)
            models = jnp.where(where, fine.coefficients, coarse.coefficients)
            fine = Fit(models, jnp.where(where, fine.variance, coarse.variance), fine.window)
        reference = luminance**2 + 0.01 * mean**2 + 1e-30
        share = signal_share(grid, fine, coarse, reference, numbers.caution)
        merged = merged + double(share, *size) * (fine.coefficients - coarse.coefficients)
        steps.append(Step(grid, fine, coarse, share, merged))
        coarse = fine
    return first, steps


def chosen(share: jax.Array, worth: jax.Array | float, height: int, width: int) -> jax.Array:
    """Whether a block of the finest grid, `(height, width)`, lies in a tile that is refined.

    Those are all where more than `worth` of what the step before added was signal: where that was
    noise, what is finer still is noise too. share: of that step.
    """
    where = halve_inside(share) > worth
    return jnp.repeat(jnp.repeat(where, TILE, 0), TILE, 1)[:height, :width]
