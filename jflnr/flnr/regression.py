"""FLNR: the pyramid of adaptive FLR under windows that a small network steers (section 3.3).

The paper's network gives the regression better guides at every pixel. One sample per pixel is so
sparse that most of what such a network does is averaging, which the pyramid does already. So here
a first regression comes before the network, which reads on blocks what its fits found. It says for
every block what else must be alike in a window, how wide the window is and how much the block
counts, and the fits are made anew; and it says where their light is too much or missing (shadows
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
from jflnr.flr.level import Grid, mean_guides
from jflnr.flr.moments import Guides, centre, index_xy, magnitude
from jflnr.flr.pyramid import halve

# Side in pixels of the finest blocks.
BLOCK = 4
# Planes in which the blocks of a window must be alike: the guides and the brightness.
ALIKE = 6
# Planes that the network gives, and where its parts end.
PLANES, ENDS = ALIKE + 2 + features.CHANNELS, (ALIKE, ALIKE + 1, ALIKE + 2)
# Logarithms of the largest factors on a block's gain, on what it counts and on its window's width.
LARGEST_GAIN, LARGEST_WEIGHT, LARGEST_WIDTH = 2.0, 2.0, 0.7


class Steered(NamedTuple):
    """What the network steers, on the finest blocks, `(h, w)`.

    moments: `(K, h, w)`, weighted. noise: `(1, h, w)`, mean squares of the weighted residuals.
    factor: `(h, w)`, which gives back brightness that the weights took. mean: brightness of the
    frame. dark: light that a gain acts on even where the models predict none.
    """

    moments: jax.Array
    noise: jax.Array
    factor: jax.Array
    mean: jax.Array
    dark: jax.Array


class Prepared(NamedTuple):
    """A frame after its first regression. Nothing in it depends on the network's weights.

    x: `(ceil(h / 2), ceil(w / 2), features.COUNT)`, what the network reads. unit: of light.
    """

    x: jax.Array
    steered: Steered
    unit: jax.Array

    @property
    def size(self) -> tuple[int, int]:
        """Of the finest grid."""
        height, width = self.steered.factor.shape
        return height, width


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
    return evaluate(heard(params, frame.x, frame.size), frame, shift, guides)


def init(key: jax.Array, widths: Sequence[int]) -> unet.Params:
    """Weights with which FLNR is adaptive FLR. widths: channels of the network, fine to coarse."""
    return unet.init(key, features.COUNT, widths, (4 * PLANES,))


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
    _, steps = widths.fit_levels(grid, shift, features.CHANNELS, adaptive.LEVELS, mean, numbers)
    factor = restoring_factor(steps[-1].merged, moments, shift.size, numbers.slack)
    x = features.of_steps(steps, shift.size, mean, None)
    # Without light there is none for the gain to act on, either.
    lit = jnp.sum(moments[index_xy(0, 0, shift.size, 1)]) > 0
    dark = jnp.where(lit, features.DARK * mean, 0)
    steered = Steered(grid.moments, grid.noise, factor, mean, dark)
    return Prepared(x, steered, unit), shift


class Heard(NamedTuple):
    """What the network says of the finest blocks; 0 everywhere changes nothing.

    alike: `(ALIKE, h, w)`, added to what must be alike in a window. wider, weight: `(1, h, w)`,
    logarithms of factors on the window's width and on what the block counts in windows. gain:
    `(C, h, w)`, logarithm of a factor on the light.
    """

    alike: jax.Array
    wider: jax.Array
    weight: jax.Array
    gain: jax.Array


def heard(params: unet.Params, x: jax.Array, size: tuple[int, int]) -> Heard:
    """Let the network read a frame of `size` blocks. x: as of `Prepared`."""
    planes = unet.unpack(unet.apply(params, x)[0], *size)
    alike, wider, weight, gain = jnp.split(planes, ENDS)
    return Heard(
        alike,
        _within(wider, LARGEST_WIDTH),
        _within(weight, LARGEST_WEIGHT),
        _within(gain, LARGEST_GAIN),
    )


def finish(says: Heard, steered: Steered, shift: jax.Array) -> jax.Array:
    """Fit anew and correct the light as the network says: models `(Q + 1, C, h, w)`."""
    weight = jnp.exp(says.weight)
    grid = Grid(steered.moments * weight, steered.noise * weight**2, BLOCK)
    # Coarser blocks are steered by the mean of the finest in them.
    planes = jnp.concatenate([says.alike, says.wider])
    said = list[widths.Said]()
    for _ in range(adaptive.LEVELS):
        said.append(widths.Said(planes[:-1], jnp.exp(planes[-1])))
        planes = halve(planes)
    levels = widths.fit_levels(
        grid,
        shift,
        features.CHANNELS,
        adaptive.LEVELS,
        steered.mean,
        ADAPTIVE_DEFAULT.numbers(),
        said,
    )
    merged = widths.merged_models(*levels) * steered.factor
    gain = jnp.exp(says.gain)
    light = (merged[:1] + steered.dark) * gain - steered.dark
    return jnp.concatenate([light, merged[1:] * gain])


def evaluate(says: Heard, frame: Prepared, shift: jax.Array, guides: Guides) -> jax.Array:
    """The denoised light `(H, W, C)` of a frame from `prepare`, as the network says."""
    means = mean_guides(frame.steered.moments, shift.size)
    coefficients = with_own_light(finish(says, frame.steered, shift), means)
    floor = ADAPTIVE_DEFAULT.numbers().floor
    return apply(coefficients, guides, shift, BLOCK, floor) * frame.unit


def _within(x: jax.Array, limit: float) -> jax.Array:
    return limit * jnp.tanh(x / limit)
