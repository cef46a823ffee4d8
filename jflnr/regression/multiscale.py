"""Widths from the data: a fit on every grid, and of each finer one as much as is signal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from jflnr.lazy import jax, jnp
from jflnr.regression.level import Fit, Grid, fit_level, guide_features, mean_guides, predict
from jflnr.regression.merge import interpolate, signal_share
from jflnr.regression.resampling import double

if TYPE_CHECKING:
    from jflnr.regression.adaptive import AdaptiveFLR


class Step(NamedTuple):
    """One level finer than what was known before.

    fine: its fit. coarse: that of the coarser level, on this grid. luminance: `(h, w)`, brightness
    known before. share: `(h, w)`, how much of their difference is signal. merged: models
    `(Q + 1, C, h, w)` with that share added.
    """

    grid: Grid
    fine: Fit
    coarse: Fit
    luminance: jax.Array
    share: jax.Array
    merged: jax.Array


def merged_models(coarsest: Fit, steps: list[Step]) -> jax.Array:
    """Models of the finest grid, put together from all levels: `(Q + 1, C, h, w)`."""
    return steps[-1].merged if steps else coarsest.coefficients


def fit_levels(
    grid: Grid, shift: jax.Array, channels: int, levels: int, mean: jax.Array, numbers: AdaptiveFLR
) -> tuple[Fit, list[Step]]:
    """The fit of the coarsest grid, and the steps from there to the finest."""
    grids = grid.pyramid(levels)

    def fit(grid: Grid, features: jax.Array, coarse: Fit) -> Fit:
        # Windows of the finest blocks are so narrow that slopes across them are hardly worth
        # their time.
        slopes = grid is not grids[0]
        return fit_level(grid, shift, channels, mean, numbers, features, slopes=slopes)

    coarsest = fit_level(grids[-1], shift, channels, mean, numbers)
    last, steps = (coarsest, coarsest.coefficients), list[Step]()
    for grid in reversed(grids[:-1]):
        steps.append(refine(grid, *last, shift.size, mean, numbers, fit))
        last = steps[-1].fine, steps[-1].merged
    return coarsest, steps


def refine(
    grid: Grid,
    coarse: Fit,
    merged: jax.Array,
    guides: int,
    mean: jax.Array,
    numbers: AdaptiveFLR,
    fit: Callable[[Grid, jax.Array, Fit], Fit],
) -> Step:
    """One level finer: its own fit, and what is merged so far with its share added.

    coarse, merged: of the coarser grid. fit: makes the models of this one, from what must be alike
    inside a window, `(F, h, w)`, and the coarser fit on this grid.
    """
    size, window = grid.moments.shape[1:], coarse.window
    coarse, merged = interpolate(coarse, *size), double(merged, *size)
    luminance = jnp.maximum(predict(merged, mean_guides(grid.moments, guides)), 0)
    # Windows end where what is known so far of the brightness changes.
    edge = numbers.brightness_scale * jnp.log(luminance / mean + 0.1)
    features = jnp.concatenate([guide_features(grid, guides, numbers), edge[None]])
    fine = fit(grid, features, coarse)
    reference = luminance**2 + 0.01 * mean**2
    share = signal_share(grid, fine, coarse, window, reference, numbers.caution)
    merged = merged + share * (fine.coefficients - coarse.coefficients)
    return Step(grid, fine, coarse, luminance, share, merged)
