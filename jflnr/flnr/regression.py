"""FLNR: the pyramid of adaptive FLR, merged and corrected by a small network (section 3.3).

The paper's network gives the regression better guides at every pixel. One sample per pixel is so
sparse that most of what such a network does is averaging, which the pyramid does already. So here
the regression comes first, at four widths, and the network reads what the fits found on blocks:
it says how much of each finer fit is signal, and where the light is too much or missing (shadows
that no guide shows, fireflies). It ends in zeros before training: FLNR then is adaptive FLR.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.flnr import features, unet
from jflnr.flr import adaptive, widths
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.apply import apply, with_borders
from jflnr.flr.arguments import check_regression
from jflnr.flr.energy import restoring_factor
from jflnr.flr.floor import with_own_light
from jflnr.flr.level import Fit, mean_guides
from jflnr.flr.moments import Guides, centre, index_xy, magnitude
from jflnr.flr.pyramid import double

# Side in pixels of the finest blocks.
BLOCK = 4
# Logarithms of the largest gain of a block, and of the largest change of a share's odds.
LARGEST_GAIN, LARGEST_CHANGE = 2.0, 3.0


class Prepared(NamedTuple):
    """A frame after its regressions: what the network reads, and what it steers.

    Nothing in it depends on the network's weights, so training makes it once.

    x: `(ceil(h / 2), ceil(w / 2), features.COUNT)`, where `(h, w)` are the finest blocks.
    coarsest: `(Q + 1, C, h', w')`, models of the coarsest grid. differences, shares: coarse to
    fine, what each finer fit adds and how much of it the variances call signal. guides:
    `(Q + 1, h, w)`, means of the finest blocks. factor: `(h, w)`, which gives back brightness that
    the weights took. mean: brightness of the frame.
    """

    x: jax.Array
    coarsest: jax.Array
    differences: tuple[jax.Array, ...]
    shares: tuple[jax.Array, ...]
    guides: jax.Array
    factor: jax.Array
    mean: jax.Array


def flnr(
    target: jax.Array, guides: Guides, params: unet.Params, *, weight: jax.Array | None = None
) -> jax.Array:
    """Denoise with the network's help. Scales with `target`.

    target: `(H, W, 3)`, the noisy radiance, not negative. guides: `(H, W, 5)` or several arrays:
    normal, depth over its typical value, ambient occlusion. params: of the network. weight:
    `(H, W)`, a mask; 0 removes a pixel, as does any value that is not finite.
    Returns `(H, W, 3)`.
    """
    check_regression(target, guides, None, weight, 2 * BLOCK, 1)
    frame, shift = prepare(target, guides, weight)
    return evaluate(params, frame, shift, guides)


def init(key: jax.Array, widths: Sequence[int], channels: int = 3) -> unet.Params:
    """Weights with which FLNR is adaptive FLR. widths: channels of the network, fine to coarse.

    It gives a change of share per block of the three finest grids, and a gain for each channel per
    block of the finest.
    """
    return unet.init(key, features.COUNT, widths, (4 * (1 + channels) + 1, 1))


def prepare(
    target: jax.Array, guides: Guides, weight: jax.Array | None
) -> tuple[Prepared, jax.Array]:
    """All that comes before the network, and the shift of the guides, `(Q,)`."""
    numbers = ADAPTIVE_DEFAULT.numbers()
    shift = centre(guides)
    unit = magnitude(target)
    moments = adaptive.collect_light(target, guides, shift, weight, BLOCK, unit)
    mean = adaptive.frame_mean(moments, shift.size)
    models = adaptive.fit_pilot(moments, mean, shift, numbers, BLOCK)
    pilot = adaptive.Pilot(with_borders(models), mean)
    grid = adaptive.collect_grid(target, guides, shift, pilot, weight, numbers, BLOCK, unit)
    coarsest, steps = widths.fit_levels(grid, shift, 3, adaptive.LEVELS, mean, numbers)
    factor = restoring_factor(steps[-1].merged, moments, shift.size, numbers.slack)
    x = features.of_steps(steps, shift.size, mean, None)
    known = prepared(x, coarsest, steps, factor, mean)
    # Without light there is none for the gain to act on, either.
    lit = jnp.sum(moments[index_xy(0, 0, shift.size, 1)]) > 0
    known = known._replace(
        coarsest=unit * known.coarsest,
        differences=tuple(unit * difference for difference in known.differences),
        mean=jnp.where(lit, unit * mean, 0),
    )
    return known, shift


def prepared(
    x: jax.Array, coarsest: Fit, steps: list[widths.Step], factor: jax.Array, mean: jax.Array
) -> Prepared:
    """What the network reads and steers, from the fits of all levels."""
    return Prepared(
        x=x,
        coarsest=coarsest.coefficients,
        differences=tuple(s.fine.coefficients - s.coarse.coefficients for s in steps),
        shares=tuple(step.share for step in steps),
        guides=mean_guides(steps[-1].grid.moments, coarsest.coefficients.shape[0] - 1),
        factor=factor,
        mean=mean,
    )


def finish(params: unet.Params, frame: Prepared) -> jax.Array:
    """Merge the levels and correct the light as the network says: `(Q + 1, C, h, w)`."""
    first, second = unet.apply(params, frame.x)[:2]
    finest = unet.unpack(first[..., :-1], *frame.factor.shape)
    merged = frame.coarsest
    changes = (second[..., 0], first[..., -1], finest[0])
    for difference, share, change in zip(frame.differences, frame.shares, changes, strict=True):
        merged = double(merged, *share.shape) + changed(share, change) * difference
    merged = merged * frame.factor
    gain = jnp.exp(_within(finest[1:], LARGEST_GAIN))
    # A gain acts on a little light even where the models predict none.
    floor = features.DARK * frame.mean
    return jnp.concatenate([(merged[:1] + floor) * gain - floor, merged[1:] * gain])


def evaluate(params: unet.Params, frame: Prepared, shift: jax.Array, guides: Guides) -> jax.Array:
    """The denoised light `(H, W, C)` of a frame from `prepare`."""
    coefficients = with_own_light(finish(params, frame), frame.guides)
    return apply(coefficients, guides, shift, BLOCK, ADAPTIVE_DEFAULT.numbers().floor)


def changed(share: jax.Array, change: jax.Array) -> jax.Array:
    """A share whose odds, share : 1 - share, are multiplied by exp(change); within [0, 1]."""
    odds = jnp.exp(_within(change, LARGEST_CHANGE))
    return share * odds / (1 + share * (odds - 1))


def _within(x: jax.Array, limit: float) -> jax.Array:
    return limit * jnp.tanh(x / limit)
