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
import numpy as np

from jflnr.flnr import features, residual, unet
from jflnr.flr import adaptive
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.apply import apply, with_borders
from jflnr.flr.arguments import check_regression
from jflnr.flr.energy import restoring_factor
from jflnr.flr.moments import Guides, centre, index_xx, index_xy
from jflnr.flr.pyramid import double

# Side in pixels of the finest blocks.
BLOCK = 4
# The gain of a block lies within exp(-2) and exp(2).
LARGEST_GAIN = 2.0


class Prepared(NamedTuple):
    """A frame after its regressions: what the network reads, and what it steers.

    Nothing in it depends on the network's weights, so training makes it once.

    x: `(ceil(h / 2), ceil(w / 2), features.COUNT)`, where `(h, w)` are the finest blocks.
    coarsest: `(Q + 1, C, h', w')`, models of the coarsest grid. differences, shares: coarse to
    fine, what each finer fit adds and how much of it the variances call signal. factor: `(h, w)`,
    which gives back brightness that the weights took. sums: `(Q + 1 + C, h, w)`, over each block,
    of a pixel's weight times [1, X - shift, Y]. mean: brightness of the frame.
    """

    x: jax.Array
    coarsest: jax.Array
    differences: tuple[jax.Array, ...]
    shares: tuple[jax.Array, ...]
    factor: jax.Array
    sums: jax.Array
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
    return apply(finish(params, frame), guides, shift, BLOCK)


def init(key: jax.Array, widths: Sequence[int], channels: int = 3) -> unet.Params:
    """Weights with which FLNR is adaptive FLR. widths: channels of the network, fine to coarse.

    Per block of the finest grid: a change of share, a gain for each channel, and what
    `residual.add_residual` takes; per block of the next two grids all of it but the gains.
    """
    own = 1 + residual.CONTROLS + features.REGRESSORS
    return unet.init(key, features.COUNT, widths, (4 * (own + channels) + own, own))


def prepare(
    target: jax.Array, guides: Guides, weight: jax.Array | None
) -> tuple[Prepared, jax.Array]:
    """All that comes before the network, and the shift of the guides, `(Q,)`."""
    numbers = ADAPTIVE_DEFAULT.numbers()
    shift = centre(guides)
    moments = adaptive.collect_light(target, guides, shift, weight, BLOCK)
    mean = adaptive.frame_mean(moments, shift.size)
    models = adaptive.fit_pilot(moments, mean, shift, numbers, BLOCK)
    pilot = adaptive.Pilot(with_borders(models), mean)
    grid = adaptive.collect_grid(target, guides, shift, pilot, weight, numbers, BLOCK)
    coarsest, steps = adaptive.fit_levels(grid, shift, 3, adaptive.LEVELS, mean, numbers)
    frame = Prepared(
        x=features.of_steps(steps, shift, mean),
        coarsest=coarsest.coefficients,
        differences=tuple(s.fine.coefficients - s.coarse.coefficients for s in steps),
        shares=tuple(step.share for step in steps),
        factor=restoring_factor(steps[-1].merged, moments, shift.size, numbers.slack),
        sums=grid.moments[_first_moments(shift.size)],
        mean=mean,
    )
    return frame, shift


def _first_moments(guides: int) -> np.ndarray:
    """Planes of the moments of a weighted pixel's [1, X, Y]."""
    ones = [index_xx(i, 0) for i in range(guides + 1)]
    return np.array(ones + [index_xy(0, c, guides, 3) for c in range(3)])


def finish(params: unet.Params, frame: Prepared) -> jax.Array:
    """Merge the levels and correct the light as the network says: `(Q + 1, C, h, w)`."""
    finest, *coarser = _controls(params, frame)
    merged = frame.coarsest
    changes = (*(control[0] for control in reversed(coarser)), finest[0])
    for difference, share, change in zip(frame.differences, frame.shares, changes, strict=True):
        merged = double(merged, *share.shape) + (share + jnp.tanh(change)) * difference
    merged = merged * frame.factor
    gains, finest = finest[1:4], finest[4:]
    controls = [finest, *(control[1:] for control in coarser)]
    merged = residual.add_residual(merged, frame.sums, controls, frame.mean)
    gain = jnp.exp(LARGEST_GAIN * jnp.tanh(gains / LARGEST_GAIN))
    # A gain acts on a little light even where the models predict none.
    floor = features.DARK * frame.mean
    return jnp.concatenate([(merged[:1] + floor) * gain - floor, merged[1:] * gain])


def _controls(params: unet.Params, frame: Prepared) -> list[jax.Array]:
    """What the network says of the blocks of each grid, fine to coarse, `(outputs, h, w)`."""
    first, second = unet.apply(params, frame.x)[:2]
    own = second.shape[-1]
    finest = unet.unpack(first[..., :-own], *frame.factor.shape)
    return [finest, jnp.moveaxis(first[..., -own:], -1, 0), jnp.moveaxis(second, -1, 0)]
