"""How the light has changed since the history was made.

A new frame minus the history is noise alone, unless the light changed: then the difference follows
the guides as the light does. So it is fitted like light, by wide windows, and what of the fit is
signal is added to the history, which thus moves with the light instead of being thrown away.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.flr.adaptive import light_of
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.apply import apply
from jflnr.flr.level import Grid, fit_level, mean_guides, predict, windowed
from jflnr.flr.moments import Guides, centre
from jflnr.flr.weighted_moments import collect_weighted
from jflnr.flr.widths import guide_features
from jflnr.flr.window import gather

# Side of the blocks in pixels. Windows reach over two of them: from one sample per pixel less
# cannot be told from noise.
BLOCK = 16
# Share of the newest frame in the evidence.
NEWEST = 0.3


class Evidence(NamedTuple):
    """What speaks for a change, averaged over the last frames, relative to the brightness.

    power: `(h, w)`, of the fitted difference. noise: `(h, w)`, of what noise alone would give.
    """

    power: jax.Array
    noise: jax.Array


def no_evidence(height: int, width: int) -> Evidence:
    """Before the first frame."""
    zeros = jnp.zeros((-(-height // BLOCK), -(-width // BLOCK)))
    return Evidence(zeros, zeros)


def find_change(
    difference: jax.Array,
    expected: jax.Array,
    guides: Guides,
    weight: jax.Array,
    evidence: Evidence,
    caution: jax.Array | float,
) -> tuple[jax.Array, jax.Array, Evidence]:
    """What of the difference between a new frame and the history is signal.

    The variance of the fit is told by its residuals, which without a change are the differences
    themselves (as in `level.py`). As in `merge.py` the Wiener filter keeps the share
    `max(power - caution noise, 0) / power`, here of a power averaged over windows and frames: a
    change goes on for some frames, and noise does not.

    difference: `(H, W, C)`. expected: `(H, W)`, brightness of the history, for the weights of
    `adaptive.py`. guides: `(H, W, Q)` or several. weight: `(H, W)`, 0 where there is no history.
    Returns the signal, `(H, W, C)`, its share, `(H, W, 1)`, and the evidence for the next frame.
    """
    numbers = ADAPTIVE_DEFAULT.numbers()
    channels, shift = difference.shape[-1], centre(guides)
    unit = _mean(expected, weight)
    difference, expected = difference / unit, jnp.maximum(expected / unit, 0)
    light = light_of(difference)
    weight = jnp.where(jnp.isfinite(light), weight / (expected + numbers.offset), 0)
    squares = jnp.where(weight > 0, weight * light, 0) ** 2
    grid = Grid(*collect_weighted(difference, guides, shift, weight, squares, BLOCK), BLOCK)
    features = guide_features(grid, shift.size, numbers)
    system = windowed(grid, features, shift, channels, jnp.ones(()), numbers)
    fit = fit_level(system, shift.size, channels)
    found = predict(fit.coefficients, mean_guides(grid.moments, shift.size)) ** 2
    there = grid.moments[0] > 1e-12
    now = gather(jnp.where(there, jnp.stack([found, fit.variance]), 0), fit.window)
    evidence = Evidence(
        *(old + NEWEST * (new - old) for old, new in zip(evidence, now, strict=True))
    )
    power = jnp.maximum(evidence.power, 1e-12)
    share = jnp.maximum(power - caution * evidence.noise, 0) / power * there
    # What is added to the history now will not be found again.
    evidence = evidence._replace(power=evidence.power * (1 - share) ** 2)
    signal = apply(share * fit.coefficients, guides, shift, BLOCK)
    pixels = apply(share[None, None], jnp.zeros((*weight.shape, 0)), shift[:0], BLOCK)
    return signal * unit, pixels, evidence


def _mean(brightness: jax.Array, weight: jax.Array) -> jax.Array:
    """Over the pixels that count; 1 where there is no light."""
    mean = jnp.sum(brightness * weight) / jnp.maximum(jnp.sum(weight), 1e-12)
    return jnp.where(mean > 0, mean, 1)
