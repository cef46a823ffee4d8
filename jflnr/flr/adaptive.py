"""FLR that adapts to the noise and to edges: weights, windows and widths from the data.

Pass 1 over the pixels collects moments of the brightness; a first fit, the pilot, comes from them.
Pass 2 weighs every pixel by the variance that the pilot predicts and collects the moments of all
channels at fine blocks. Everything else happens on blocks: a pyramid of grids, on each the same
edge-aware window, and from each finer grid as much of the difference to the coarser one as is
signal. Pass 3 evaluates the models. docs/adaptive.md derives the steps.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks
from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.apply import apply, apply_rows, with_borders
from jflnr.flr.arguments import check_regression
from jflnr.flr.energy import rescale, restore
from jflnr.flr.floor import with_own_light
from jflnr.flr.level import Fit, Grid, brightness, fit_level, mean_guides, windowed
from jflnr.flr.moments import Guides, centre, collect, collect_weighted, index_xy, magnitude, planes
from jflnr.flr.pyramid import halve
from jflnr.flr.widths import Step, fit_levels, guide_features, merged_models

BLOCK = 8
LEVELS = 4


class Pilot(NamedTuple):
    """The first fit, of the brightness at blocks of 16 pixels (four of the finest).

    coefficients: `(Q + 1, 1, h + 2, w)`, a row of blocks beyond each border. mean: brightness of
    the frame.
    """

    coefficients: jax.Array
    mean: jax.Array


class Fitted(NamedTuple):
    """The models of a frame, and what they were found by.

    coefficients: `(Q + 1, C, h, w)`, of the finest blocks. grid: what these were fitted to.
    coarsest, steps: all levels. shift: `(Q,)`. mean: brightness of the frame. unit: what the light
    was divided by.
    """

    coefficients: jax.Array
    grid: Grid
    coarsest: Fit
    steps: list[Step]
    shift: jax.Array
    mean: jax.Array
    unit: jax.Array


def flr_adaptive(
    target: jax.Array,
    guides: Guides,
    parameters: AdaptiveParameters,
    *,
    block: int = BLOCK,
    levels: int = LEVELS,
    weight: jax.Array | None = None,
    keep_energy: bool = False,
) -> jax.Array:
    """Fit the guides to a noisy image, adapting to its noise and its edges.

    Scales with `target`. Not linear in it, but the channels are treated alike: images of three
    channels denoised together as light groups (C = 3, 6, ...) sum to the denoised sum.

    target: `(H, W, C)`, the noisy radiance Y, not negative. guides: `(H, W, Q)`, X without the
    constant, or several such arrays. parameters: the fitted constants. block: side in pixels of
    the blocks of pass 1; the finest models have half of it. levels: number of grids, each twice as
    coarse. weight: `(H, W)`, numbers or a boolean mask; 0 removes a pixel, as does any value that
    is not finite. keep_energy: give every frame exactly the mean brightness of its input, instead
    of nearly.
    Returns `(H, W, C)`.

    Raises `ValueError` or `TypeError`, naming the argument, if shapes, types or options are wrong.
    """
    models = fit_frame(target, guides, parameters, block, levels, weight)
    image = image_of(models, guides, parameters.numbers())
    if keep_energy:
        image = rescale(image, light_of(target, models.unit), weight)
    return image * models.unit


def fit_frame(
    target: jax.Array,
    guides: Guides,
    parameters: AdaptiveParameters,
    block: int,
    levels: int,
    weight: jax.Array | None,
) -> Fitted:
    """Everything but the last pass over the pixels; arguments as of `flr_adaptive`."""
    check_regression(target, guides, None, weight, block, 1)
    checks.positive_integer("levels", levels)
    numbers = parameters.numbers()
    shift = centre(guides)
    unit = magnitude(target)
    block = max(block // 2, 1)
    moments = collect_light(target, guides, shift, weight, block, unit)
    mean = frame_mean(moments, shift.size)
    pilot = Pilot(with_borders(fit_pilot(moments, mean, shift, numbers, block)), mean)
    grid = collect_grid(target, guides, shift, pilot, weight, numbers, block, unit)
    coarsest, steps = fit_levels(grid, shift, target.shape[-1], levels, mean, numbers)
    coefficients = restore(merged_models(coarsest, steps), moments, shift.size, numbers.slack)
    return Fitted(coefficients, grid, coarsest, steps, shift, mean, unit)


def image_of(models: Fitted, guides: Guides, numbers: AdaptiveParameters) -> jax.Array:
    """Pass 3: the light of every pixel, `(H, W, C)`, in the fit's own unit."""
    means = mean_guides(models.grid.moments, models.shift.size)
    coefficients = with_own_light(models.coefficients, means)
    return apply(coefficients, guides, models.shift, models.grid.block, numbers.floor)


def light_of(target: jax.Array, unit: jax.Array | float = 1) -> jax.Array:
    """Brightness of the pixels over `unit`, `(H, W, C)` to `(H, W)`."""
    weights = brightness(target.shape[-1], target.dtype)
    return sum(
        (w * (plane / unit) for w, plane in zip(weights, planes(target), strict=True)),
        jnp.zeros(target.shape[:2], target.dtype),
    )


def collect_light(
    target: jax.Array,
    guides: Guides,
    shift: jax.Array,
    weight: jax.Array | None,
    block: int,
    unit: jax.Array | float = 1,
) -> jax.Array:
    """Pass 1: unweighted moments of the brightness over `unit`, on blocks of twice `block`."""
    return collect(light_of(target, unit)[..., None], guides, shift, 2 * block, weight)


def frame_mean(moments: jax.Array, guides: int) -> jax.Array:
    """Mean brightness of the usable pixels; 1 if there is no light, where any scale will do."""
    mean = jnp.sum(moments[index_xy(0, 0, guides, 1)]) / jnp.maximum(jnp.sum(moments[0]), 1e-12)
    return jnp.where(mean > 0, mean, 1)


def fit_pilot(
    moments: jax.Array, mean: jax.Array, shift: jax.Array, numbers: AdaptiveParameters, block: int
) -> jax.Array:
    """Models of the brightness from the moments of pass 1. Returns `(Q + 1, 1, h, w)`."""
    grid = Grid(halve(moments), jnp.zeros_like(halve(moments[:1])), 4 * block)
    features = guide_features(grid, shift.size, numbers)
    system = windowed(grid, features, shift, 1, mean, numbers)
    return fit_level(system, shift.size, 1).coefficients


def collect_grid(
    target: jax.Array,
    guides: Guides,
    shift: jax.Array,
    pilot: Pilot,
    weight: jax.Array | None,
    numbers: AdaptiveParameters,
    block: int,
    unit: jax.Array | float = 1,
) -> Grid:
    """Pass 2: moments of the weighted pixels on the finest blocks, of the light over `unit`."""
    expected = apply_rows(pilot.coefficients, guides, shift, 4 * block)[..., 0]
    light = light_of(target, unit)
    weights, squares = _weights(light, guides, expected, pilot.mean, weight, numbers)
    return Grid(*collect_weighted(target, guides, shift, weights, squares, block, unit), block)


def _weights(
    light: jax.Array,
    guides: Guides,
    expected: jax.Array,
    mean: jax.Array,
    weight: jax.Array | None,
    numbers: AdaptiveParameters,
) -> tuple[jax.Array, jax.Array]:
    """Each pixel's weight from what the pilot expects, and the noise that leaves.

    The variance of a pixel grows with its brightness, and the best weight is one over it.
    light, expected: `(H, W)`.
    Returns the weights, 0 where a pixel cannot be used, and squared weighted residuals, `(H, W)`.
    """
    # The floor is there for the logarithm; written so, the power takes a quarter of the time.
    relative = jnp.log(jnp.maximum(expected / mean, 1e-6))
    weights = 1 / (jnp.exp(numbers.exponent * relative) + numbers.offset)
    usable = jnp.isfinite(light)
    for layer in jax.tree.leaves(guides):
        usable &= jnp.all(jnp.isfinite(layer), axis=-1)
    if weight is not None:
        usable &= (weight > 0) & jnp.isfinite(weight)
        weights *= weight
    weights = jnp.where(usable, weights, 0)
    return weights, jnp.where(usable, weights * (light - expected), 0) ** 2
