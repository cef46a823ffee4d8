"""How the light has changed since the history was made.

A new frame minus the history is noise alone, unless the light changed: then the difference follows
the guides as the light does. So it is fitted like light, by wide windows, and what of the fit is
signal is added to the history, which thus moves with the light instead of being thrown away.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jflnr.regression.adaptive import DEFAULT, light_of
from jflnr.regression.apply import apply
from jflnr.regression.level import Fit, Grid, fit_level, mean_guides, predict
from jflnr.regression.moments import Guides, centre, collect, collect_weighted
from jflnr.regression.window import gather

# Side of the blocks in pixels. Windows have a standard deviation of two of them: from one sample
# per pixel less cannot be told from noise.
BLOCK = 32
# Share of the newest frame in the evidence.
NEWEST = 0.5
# How much of the evidence for a change goes when that is added; the rest says that it goes on.
FOLLOWED = 0.7
# Changes count relative to the brightness, of which this share of the frame's mean is added.
DIM = 0.3
# What is brighter than this many times the mean counts as that bright, so that its fourth power is
# finite.
BRIGHTEST = 1e8
# Frames of noise that the history takes on where the light is all new: how wrong its details are.
NOVELTY = 10.0
# Around what comes into view it takes on one, in full where this part of a block has come.
UNCOVERED = 0.25


class Evidence(NamedTuple):
    """What speaks for a change, averaged over the last frames, relative to the brightness.

    power: `(h, w)`, of the fitted difference. noise: `(h, w)`, of what noise alone would give.
    """

    power: jax.Array
    noise: jax.Array


class Change(NamedTuple):
    """What has changed. signal: `(H, W, C)`, to be added to the history. noise: `(H, W, 1)`, what
    the history takes on by it, in variances of one frame."""

    signal: jax.Array
    noise: jax.Array


def no_evidence(height: int, width: int) -> Evidence:
    """Before the first frame."""
    zeros = jnp.zeros((-(-height // BLOCK), -(-width // BLOCK)))
    return Evidence(zeros, zeros)


def find_change(
    difference: jax.Array,
    expected: jax.Array,
    guides: Guides,
    known: jax.Array,
    new: jax.Array,
    evidence: Evidence,
    caution: jax.Array | float,
) -> tuple[Change, Evidence]:
    """What of the difference between a new frame and the history is signal.

    difference: `(H, W, C)`. expected: `(H, W)`, brightness of the history, for the weights of
    `adaptive.py`. guides: `(H, W, Q)` or several. known, new: `(H, W)`, 1 where there is something
    to denoise, with a history and without, else 0.
    Returns the change, and the evidence for the next frame.
    """
    numbers, shift, unit = DEFAULT, centre(guides), _mean(expected, known)
    usable = jnp.isfinite(light_of(difference))
    difference = jnp.clip(difference / unit, -BRIGHTEST, BRIGHTEST)
    expected = jnp.clip(expected / unit, 0, BRIGHTEST)
    light = light_of(difference)
    for layer in jax.tree.leaves(guides):
        usable &= jnp.all(jnp.isfinite(layer), axis=-1)
    weight = jnp.where(usable, known / (expected + numbers.offset), 0)
    squares = jnp.where(weight > 0, weight * light, 0) ** 2
    grid = Grid(*collect_weighted(difference, guides, shift, weight, squares, BLOCK), BLOCK)
    count, total = collect(expected[..., None], (), shift[:0], BLOCK, weight)
    # Its variance is told by its residuals, which without a change are the differences themselves.
    fit = fit_level(grid, shift, difference.shape[-1], jnp.ones(()), numbers)
    found = predict(fit.coefficients, mean_guides(grid.moments, shift.size))
    luminance = total / jnp.maximum(count, 1e-12)
    there = grid.moments[0] > 1e-12
    share, noise, evidence = _judge(fit, found, luminance, there, evidence, caution)
    noise += _uncovered(known, new)
    signal = apply(share * fit.coefficients, guides, shift, BLOCK)
    noise = apply(noise[None, None], jnp.zeros((*light.shape, 0)), shift[:0], BLOCK)
    return Change(signal * unit, noise), evidence


def _uncovered(known: jax.Array, new: jax.Array) -> jax.Array:
    """What the history takes on around places that come into view, `(h, w)`.

    Something moved there, and with it its shadow, which is too small to be told from noise.
    """
    no_guides = jnp.zeros(0)
    _, old, came = collect(jnp.stack([known, new], axis=-1), (), no_guides, BLOCK)
    return jnp.minimum(came / jnp.maximum(UNCOVERED * (old + came), 1e-12), 1)


def _mean(brightness: jax.Array, weight: jax.Array) -> jax.Array:
    """Over the pixels that count; 1 where there is next to no light."""
    mean = jnp.sum(brightness * (weight / jnp.maximum(jnp.sum(weight), 1e-12)))
    return jnp.where(mean > 1e-30, mean, 1)


def _judge(
    fit: Fit,
    found: jax.Array,
    luminance: jax.Array,
    there: jax.Array,
    evidence: Evidence,
    caution: jax.Array | float,
) -> tuple[jax.Array, jax.Array, Evidence]:
    """How much of the fit is signal, and how wrong that makes the details of the history.

    As in `merge.py` the Wiener filter keeps the share `max(power - caution noise, 0) / power`, here
    of a power averaged over windows and frames: a change goes on for some frames, and noise does
    not. Most of what is added to the history now will not be found again. The details are the more
    wrong, the more of the light is new.

    found, luminance: `(h, w)`, brightness of the fit and of the history. there: `(h, w)`, boolean.
    Returns the share and the noise, `(h, w)`, and the evidence for the next frame.
    """
    relative = 1 / (luminance + DIM) ** 2
    planes = found**2 * relative, fit.variance * relative, found**2, luminance**2, 0 * luminance + 1
    power, noise, new, old, count = gather(jnp.where(there, jnp.stack(planes), 0), fit.window)
    power = jnp.maximum(evidence.power + NEWEST * (power - evidence.power), 1e-12)
    noise = evidence.noise + NEWEST * (noise - evidence.noise)
    share = jnp.where(there, jnp.maximum(power - caution * noise, 0) / power, 0)
    new *= share**2
    wrong = NOVELTY * new / (new + old + 0.01 * count + 1e-12)
    return share, wrong, Evidence(power * (1 - FOLLOWED * share), noise)
