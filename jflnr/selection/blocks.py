"""The cheap form: one pass over the pixels, and on blocks a model no larger than each one needs.

The moments of the frame are collected once. Everything else happens on blocks: weights from a first
fit, a pyramid of window widths, on every grid the average of all orders of model (`nested.py`), and
from each finer grid as much of the difference as is signal. docs/select.md derives the steps.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.flr.adaptive import frame_mean
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.flr.arguments import check_regression
from jflnr.flr.energy import restore
from jflnr.flr.level import Fit, Grid, brightness, fit_level, mean_guides, predict, windowed
from jflnr.flr.merge import interpolate, signal_share
from jflnr.flr.moments import Guides, centre, collect, index_xx, index_xy, magnitude
from jflnr.flr.pyramid import double, halve
from jflnr.flr.uncertainty import DETAIL, LEFT_OUT, VARIANCE
from jflnr.flr.widths import guide_features
from jflnr.selection.nested import fit_orders

# Side in pixels of the finest blocks, and how often they are halved from the coarsest to them.
BLOCK, HALVINGS = 8, 3
# Chosen on train and val. Blocks differ less from their pixels than pixels do, so weights may fall
# more steeply with brightness than in adaptive FLR.
SETTINGS = ADAPTIVE_DEFAULT.but(sigma=1.5, exponent=1.5, offset=0.1, brightness_scale=1.6)
# Factor on what a group of guides explains of noise: the ridge has taken most of it already.
ORDER_CAUTION = 0.3


class Collected(NamedTuple):
    """What a frame's fit needs of its pixels; all light is divided by `unit`.

    moments: `(K, h, w)`. squares: `(h, w)`, mean square of the brightness. shift: `(Q,)`. unit: of
    light.
    """

    moments: jax.Array
    squares: jax.Array
    shift: jax.Array
    unit: jax.Array

    @property
    def channels(self) -> int:
        count = self.shift.size + 1
        return (self.moments.shape[0] - count * (count + 1) // 2) // count

    def of_guides(self, kept: Sequence[int]) -> Collected:
        """As if only these guides had been collected: a sub-matrix of the same moments."""
        rows = [0, *(q + 1 for q in kept)]
        planes = [index_xx(i, j) for n, i in enumerate(rows) for j in rows[: n + 1]]
        count, channels = self.shift.size, self.channels
        planes += [index_xy(i, c, count, channels) for i in rows for c in range(channels)]
        shift = self.shift[np.array(kept, int)]
        return self._replace(moments=self.moments[np.array(planes)], shift=shift)

    def light(self) -> jax.Array:
        """Moments of the brightness alone."""
        count = self.shift.size + 1
        xx = count * (count + 1) // 2
        cross = self.moments[xx:].reshape(count, self.channels, *self.moments.shape[1:])
        weights = brightness(self.channels, self.moments.dtype)
        return jnp.concatenate([self.moments[:xx], jnp.einsum("qchw,c->qhw", cross, weights)])


class Models(NamedTuple):
    """The fitted models, and what was chosen.

    coefficients: `(Q + 1, C, h, w)`. order: `(h, w)`, how many groups of guides they use. width:
    `(h, w)`, how often the coarsest blocks were halved. level, error: `(h, w)`, the brightness and
    its expected squared error. share: `(h, w)`, how much of the last halving is signal. gains:
    `(G,)`, mean square of what each group of guides does inside blocks. mean: of the brightness.
    All in the unit of `Collected`.
    """

    coefficients: jax.Array
    order: jax.Array
    width: jax.Array
    level: jax.Array
    error: jax.Array
    share: jax.Array
    gains: jax.Array
    mean: jax.Array


class Progress(NamedTuple):
    """How far a frame's fit has come, from coarse grids to finer ones.

    fit: by itself, of the last grid. merged: the models put together so far. variance, left_out:
    parts of the expected squared error. The rest as in `Models`.
    """

    mean: jax.Array
    fit: Fit
    merged: jax.Array
    order: jax.Array
    width: jax.Array
    level: jax.Array
    variance: jax.Array
    left_out: jax.Array
    share: jax.Array


def collect_frame(target: jax.Array, guides: Guides, weight: jax.Array | None = None) -> Collected:
    """The one pass: moments of all channels, and the mean square of the brightness, 8 x 8 pixels.

    target: `(H, W, C)`, noisy radiance, not negative. guides: `(H, W, Q)`, or several arrays.
    weight: `(H, W)`, a mask; 0 removes a pixel, as does any value that is not finite.
    """
    check_regression(target, guides, None, weight, BLOCK, 1)
    shift = centre(guides)
    unit = magnitude(target)
    channels = target.shape[-1]
    weights = brightness(channels, unit.dtype) / unit
    planes = collect(target, guides, shift, BLOCK, weight, weights)
    xx = index_xy(0, 0, shift.size, channels)
    moments = jnp.concatenate([planes[:xx], planes[xx:-1] / unit])
    return Collected(moments, planes[-1], shift, unit)


@functools.partial(jax.jit, static_argnames="groups")
def fit(collected: Collected, groups: tuple[int, ...]) -> Models:
    """Fit the models of every block, coarse to fine. Compiled once per size of the grid.

    groups: numbers of guides that enter together, in order.
    """
    numbers = SETTINGS.numbers()
    light, count = collected.light(), collected.shift.size
    mean = frame_mean(light, count)
    grids = [_weighted(collected, light, mean, numbers)]
    for _ in range(HALVINGS):
        last = grids[-1]
        grids.append(Grid(halve(last.moments), halve(last.noise), 2 * last.block))
    progress = _widest(grids.pop(), collected, groups, mean, numbers)
    for number, grid in enumerate(reversed(grids), 1):
        progress = _refined(progress, grid, number, collected, groups, numbers)
    coefficients = restore(progress.merged, halve(light), count, numbers.slack)
    error = VARIANCE * progress.variance + LEFT_OUT * progress.left_out
    return Models(
        coefficients=coefficients,
        order=progress.order,
        width=progress.width,
        level=progress.level,
        error=error + DETAIL * progress.level**2,
        share=progress.share,
        gains=_gains(coefficients, collected, groups),
        mean=mean,
    )


def _widest(
    grid: Grid,
    collected: Collected,
    groups: tuple[int, ...],
    mean: jax.Array,
    numbers: AdaptiveParameters,
) -> Progress:
    """The models of the coarsest grid."""
    count = collected.shift.size
    features = guide_features(grid, count, numbers)
    fit, order = _fit_grid(grid, features, collected, groups, mean, numbers)
    level = predict(fit.coefficients, mean_guides(grid.moments, count))
    zero, one = jnp.zeros_like(order), jnp.ones_like(order)
    merged = fit.coefficients
    return Progress(mean, fit, merged, order, zero, level, fit.variance, zero, one)


def _gains(coefficients: jax.Array, collected: Collected, groups: tuple[int, ...]) -> jax.Array:
    """Mean over the frame of a' cov(x) a inside the blocks, for the slopes a of each group."""
    weights = brightness(collected.channels, coefficients.dtype)
    slopes = jnp.einsum("qchw,c->qhw", coefficients[1:], weights)
    count = collected.moments[0]
    means = mean_guides(collected.moments, collected.shift.size)[1:]
    found = []
    for end, size in zip(np.cumsum(groups), groups, strict=True):
        total = jnp.zeros(())
        for i, j in np.ndindex(size, size):
            a, b = end - size + i, end - size + j
            inside = collected.moments[index_xx(a + 1, b + 1)] - count * means[a] * means[b]
            total += jnp.sum(slopes[a] * slopes[b] * inside)
        found.append(total / jnp.maximum(jnp.sum(count), 1e-12))
    return jnp.stack(found) if found else jnp.zeros(0)


def hold(coefficients: jax.Array, collected: Collected, used: Sequence[int]) -> jax.Array:
    """The models with every other guide held at its block's mean: those of the guides `used`.

    coefficients: `(Q + 1, C, h, w)`, on the blocks of `collected`. Returns `(U + 1, C, h, w)`.
    """
    means = mean_guides(collected.moments, collected.shift.size)
    held = [q for q in range(collected.shift.size) if q not in used]
    value = coefficients[0]
    for q in held:
        value = value + coefficients[q + 1] * means[q + 1]
    return jnp.concatenate([value[None], coefficients[np.array(used, int) + 1]])


def _weighted(
    collected: Collected, light: jax.Array, mean: jax.Array, numbers: AdaptiveParameters
) -> Grid:
    """The finest grid, each block weighed by one over the variance that a first fit expects."""
    count = collected.shift.size
    coarse = Grid(halve(light), jnp.zeros_like(halve(light[:1])), 2 * BLOCK)
    wide = numbers._replace(sigma=2.0)
    features = guide_features(coarse, count, numbers)
    system = windowed(coarse, features, collected.shift, 1, mean, wide)
    pilot = fit_level(system, collected.shift.size, 1).coefficients
    pilot = double(pilot, *light.shape[1:])
    level = predict(pilot, mean_guides(light, count))
    squares = squared_residual(light, collected.squares, pilot[:, 0])
    # The floor is there for the derivative of the power at 0.
    relative = jnp.maximum(level / mean, 1e-6)
    weights = 1 / (relative**numbers.exponent + numbers.offset)
    return Grid(collected.moments * weights, (squares * weights**2)[None], BLOCK)


def squared_residual(light: jax.Array, squares: jax.Array, model: jax.Array) -> jax.Array:
    """Mean square of brightness minus model, `(h, w)`, from moments: yy - 2 a.xy + a.xx.a.

    light: moments of the brightness. squares: `(h, w)`. model: `(Q + 1, h, w)`.
    """
    count = model.shape[0]
    pairs = np.array([[index_xx(i, j) for j in range(count)] for i in range(count)])
    cross = light[count * (count + 1) // 2 :]
    fitted = jnp.einsum("ijhw,jhw->ihw", light[pairs], model)
    return jnp.maximum(squares + jnp.sum(model * (fitted - 2 * cross), axis=0), 0)


def _refined(
    last: Progress,
    grid: Grid,
    number: int,
    collected: Collected,
    groups: tuple[int, ...],
    numbers: AdaptiveParameters,
) -> Progress:
    """One grid finer: of its models, as much of the difference to the coarser ones as is signal.

    number: of halvings so far.
    """
    size, count = grid.moments.shape[1:], collected.shift.size
    coarse = interpolate(last.fit, *size)
    merged, order, width, variance, left_out = (
        double(planes, *size)
        for planes in (last.merged, last.order, last.width, last.variance, last.left_out)
    )
    regressors = mean_guides(grid.moments, count)
    level = jnp.maximum(predict(merged, regressors), 0)
    # Windows end where what is known so far of the brightness changes.
    edge = numbers.brightness_scale * jnp.log(level / last.mean + 0.1)
    features = jnp.concatenate([guide_features(grid, count, numbers), edge[None]])
    slopes = number < HALVINGS
    fine, fine_order = _fit_grid(grid, features, collected, groups, last.mean, numbers, slopes)
    reference = level**2 + 0.01 * last.mean**2
    share = signal_share(grid, fine, coarse, last.fit.window, reference, numbers.caution)
    change = fine.coefficients - coarse.coefficients
    return last._replace(
        fit=fine,
        merged=merged + share * change,
        order=order + share * (fine_order - order),
        width=width + share * (number - width),
        level=level,
        variance=variance + share * jnp.maximum(fine.variance - coarse.variance, 0),
        left_out=left_out + ((1 - share) * predict(change, regressors)) ** 2,
        share=share,
    )


def _fit_grid(
    grid: Grid,
    features: jax.Array,
    collected: Collected,
    groups: tuple[int, ...],
    mean: jax.Array,
    numbers: AdaptiveParameters,
    slopes: bool = True,
) -> tuple[Fit, jax.Array]:
    """The models of one grid, all orders averaged, and how many groups are in them, `(h, w)`.

    slopes: whether the position in the window is a last group of two guides.
    """
    shift, channels = collected.shift, collected.channels
    system = windowed(grid, features, shift, channels, mean, numbers, slopes=slopes)
    regular = system.eps, system.eps_prime
    noise = ORDER_CAUTION * system.variance
    all_groups = (*groups, 2) if slopes else groups
    orders = fit_orders(system.moments, system.shift, regular, noise, all_groups, channels)
    order = jnp.sum(orders.shares[: len(groups)], axis=0)
    return Fit(orders.coefficients[: shift.size + 1], system.variance, system.window), order
