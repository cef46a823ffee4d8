"""The cheap form: one pass over the pixels, and on blocks a model no larger than each one needs.

The moments of the frame are collected once. Everything else happens on blocks: weights from a first
fit, a pyramid of windows, on every grid the average of all orders of model (`nested.py`), and
from each finer grid as much of the difference as is signal. On the finest grid the models are first
only shifted; whole ones can follow, when it is known whether they are worth their time.
docs/select.md derives the steps.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.auto.collected import Collected, inside
from jflnr.auto.nested import fit_orders
from jflnr.auto.weights import SETTINGS, weigh, weighted
from jflnr.regression.adaptive import mean_light
from jflnr.regression.energy import restore
from jflnr.regression.level import Fit, Grid, guide_features, mean_guides, predict, windowed
from jflnr.regression.moments import index_xx, index_xy
from jflnr.regression.multiscale import refine as refine_grid
from jflnr.regression.resampling import double, halve
from jflnr.regression.uncertainty import DETAIL, Error
from jflnr.regression.window import gather, window_over

# Side in pixels of the coarsest blocks.
COARSEST = 64
# Windows of smaller blocks are so narrow that slopes across them are hardly worth their time.
SLOPES = 16
# Factor on what a group of guides explains of noise: the ridge has taken most of it already.
ORDER_CAUTION = 0.2
# Of what the guides do inside a block: how much is expected to be wrong, found on training frames.
INSIDE = 0.4


class Models(NamedTuple):
    """The fitted models, and what was chosen.

    coefficients: `(Q + 1, C, h, w)`. means: `(Q + 1, h, w)`, of each block's guides. usable:
    `(h, w)`, how much of each block can be used. order: `(h, w)`, how many groups of guides they
    use. width: `(h, w)`, how often the coarsest blocks were halved. luminance, error: `(h, w)`, the
    brightness and its expected squared error. share: `(h, w)`, how much of the last halving is
    signal. gains: `(G,)`, mean square of what each group of guides does inside blocks. mean: of the
    brightness. All in the unit of `Collected`.
    """

    coefficients: jax.Array
    means: jax.Array
    usable: jax.Array
    order: jax.Array
    width: jax.Array
    luminance: jax.Array
    error: jax.Array
    share: jax.Array
    gains: jax.Array
    mean: jax.Array


class Progress(NamedTuple):
    """How far a frame's fit has come, from coarse grids to finer ones.

    fit: by itself, of the last grid. merged: the models put together so far. The rest as in
    `Models`.
    """

    mean: jax.Array
    fit: Fit
    merged: jax.Array
    order: jax.Array
    width: jax.Array
    luminance: jax.Array
    error: Error
    share: jax.Array


class Unfinished(NamedTuple):
    """What the finest grid needs: weights and squares of `weigh`, and the progress so far."""

    weights: jax.Array
    squares: jax.Array
    progress: Progress


@functools.partial(jax.jit, static_argnames=("groups", "block"))
def fit(collected: Collected, groups: tuple[int, ...], block: int) -> tuple[Models, Unfinished]:
    """Fit models of blocks twice as large as those collected, and shift them on these.

    Compiled once per size of the grid. groups: numbers of guides that enter together, in order.
    block: side in pixels of the blocks collected, a power of two below half of `COARSEST`.
    """
    light = collected.light()
    mean = mean_light(jnp.sum(light[0]), jnp.sum(light[index_xy(0, 0, collected.shift.size, 1)]))
    weights, squares = weigh(collected, light, mean, block)
    finest = weighted(collected, weights, squares, block)
    grids = finest.pyramid((COARSEST // block).bit_length())
    progress = _widest(grids.pop(), collected, groups, mean)
    for number, grid in enumerate(reversed(grids[1:]), 1):
        progress = _refined(progress, grid, number, collected, groups)
    unfinished = Unfinished(weights, squares, progress)
    progress = _refined(progress, finest, number + 1, collected, groups, shifted=True)
    return _models(progress, halve(light), collected, groups), unfinished


@functools.partial(jax.jit, static_argnames=("groups", "block"))
def refine(
    collected: Collected, unfinished: Unfinished, groups: tuple[int, ...], block: int
) -> Models:
    """Whole models of the blocks collected, from what `fit` left; arguments as there."""
    grid = weighted(collected, unfinished.weights, unfinished.squares, block)
    number = (COARSEST // block).bit_length() - 1
    progress = _refined(unfinished.progress, grid, number, collected, groups)
    return _models(progress, halve(collected.light()), collected, groups)


def _models(
    progress: Progress, light: jax.Array, collected: Collected, groups: tuple[int, ...]
) -> Models:
    """What the progress has come to. light: moments of the brightness, on twice larger blocks."""
    count = collected.shift.size
    coefficients = restore(progress.merged, light, count, SETTINGS.slack)
    moments = collected.moments[: index_xy(0, 0, count, 0)]
    done = inside(coefficients, moments, groups)
    error = (
        progress.error.square() + DETAIL * progress.luminance**2 + INSIDE * jnp.sum(done, axis=0)
    )
    return Models(
        coefficients=coefficients,
        means=mean_guides(moments, count),
        usable=moments[0],
        order=progress.order,
        width=progress.width,
        luminance=progress.luminance,
        error=error,
        share=progress.share,
        gains=jnp.sum(moments[0] * done, axis=(1, 2)) / jnp.maximum(jnp.sum(moments[0]), 1e-12),
        mean=progress.mean,
    )


def _widest(grid: Grid, collected: Collected, groups: tuple[int, ...], mean: jax.Array) -> Progress:
    """The models of the coarsest grid."""
    count = collected.shift.size
    features = guide_features(grid, count, SETTINGS)
    fit, order = _fit_grid(grid, features, collected, groups, mean)
    luminance = predict(fit.coefficients, mean_guides(grid.moments, count))
    zero, one = jnp.zeros_like(order), jnp.ones_like(order)
    merged = fit.coefficients
    return Progress(mean, fit, merged, order, zero, luminance, Error.of(fit), one)


def _refined(
    last: Progress,
    grid: Grid,
    number: int,
    collected: Collected,
    groups: tuple[int, ...],
    shifted: bool = False,
) -> Progress:
    """One grid finer: of its models, as much of the difference to the coarser ones as is signal.

    number: of halvings so far. shifted: let the models be the coarser ones, shifted, which costs
    little.
    """
    size, count, mean = grid.moments.shape[1:], collected.shift.size, last.mean
    order, width = (double(planes, *size) for planes in (last.order, last.width))
    found = [order]

    def own_fit(grid: Grid, features: jax.Array, coarse: Fit) -> Fit:
        if shifted:
            return _shift_grid(grid, features, coarse, collected)
        slopes = grid.block >= SLOPES
        fine, found[0] = _fit_grid(grid, features, collected, groups, mean, slopes)
        return fine

    step = refine_grid(grid, last.fit, last.merged, count, mean, SETTINGS, own_fit)
    return Progress(
        mean=mean,
        fit=step.fine,
        merged=step.merged,
        order=order + step.share * (found[0] - order),
        width=width + step.share * (number - width),
        luminance=step.luminance,
        error=last.error.after(step),
        share=step.share,
    )


def _shift_grid(grid: Grid, features: jax.Array, coarse: Fit, collected: Collected) -> Fit:
    """The models of a coarser grid, each shifted by the mean of what it leaves under the window.

    Sums of a few planes instead of moments and a solve.
    """
    count, channels = collected.shift.size, collected.channels
    window = window_over(features, SETTINGS.sigma)
    sums = grid.moments[np.array([index_xx(i, 0) for i in range(count + 1)])]
    light = grid.moments[index_xy(0, 0, count, channels) :][:channels]
    left = light - jnp.einsum("qchw,qhw->chw", coarse.coefficients, sums)
    under = gather(jnp.concatenate([sums[:1], left]), window)
    n = jnp.maximum(under[0], 1e-12)
    inverse = 1 / (n * grid.block)
    variance = gather(grid.noise, window.squared())[0] * inverse * inverse
    return Fit(coarse.coefficients.at[0].add(under[1:] / n), variance, window)


def _fit_grid(
    grid: Grid,
    features: jax.Array,
    collected: Collected,
    groups: tuple[int, ...],
    mean: jax.Array,
    slopes: bool = True,
) -> tuple[Fit, jax.Array]:
    """The models of one grid, all orders averaged, and how many groups are in them, `(h, w)`.

    slopes: whether the position in the window is a last group of two guides.
    """
    shift, channels = collected.shift, collected.channels
    system = windowed(grid, features, shift, channels, mean, SETTINGS, slopes=slopes)
    regular = system.eps, system.eps_prime
    noise = ORDER_CAUTION * system.variance
    all_groups = (*groups, 2) if slopes else groups
    orders = fit_orders(system.moments, system.shift, regular, noise, all_groups, channels)
    order = jnp.sum(orders.shares[: len(groups)], axis=0)
    return Fit(orders.coefficients[: shift.size + 1], system.variance, system.window), order
