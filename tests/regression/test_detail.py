"""What must hold of the detail that is given back to a picture."""

import jax
import numpy as np

from jflnr.regression import detail
from jflnr.regression.detail import find_detail

HEIGHT, WIDTH = 40, 56
UNIT = np.ones((1, 1, 1), np.float32)
found = jax.jit(find_detail)


def noisy_and_flat(rng, spread, samples=8):
    """Squares of 12 x 12 pixels under noise; and a fit that does not know of them."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] // 12
    truth = 1 + spread * ((y + x) % 2 - 0.5)[..., None] * np.ones(3)
    noise = rng.gamma(samples, 1 / samples, truth.shape)
    return np.float32(truth * noise), np.ones_like(truth, np.float32), truth


def everything():
    return np.ones((HEIGHT, WIDTH), np.float32)


def test_detail_that_exceeds_the_noise_comes_back(rng):
    noisy, fitted, truth = noisy_and_flat(rng, 0.6, samples=64)
    result = fitted + found(noisy, fitted, everything(), UNIT)
    assert np.mean((result - truth) ** 2) < 0.5 * np.mean((fitted - truth) ** 2)


def test_noise_does_not(rng):
    noisy, fitted, truth = noisy_and_flat(rng, 0)
    result = fitted + found(noisy, fitted, everything(), UNIT)
    assert np.mean((result - truth) ** 2) < 0.02 * np.mean((noisy - truth) ** 2)


def test_what_the_fit_explains_stays(rng):
    _, fitted, _ = noisy_and_flat(rng, 0.4)
    assert np.all(found(fitted, fitted, everything(), UNIT) == 0)


def test_scales_with_the_light(rng):
    noisy, fitted, _ = noisy_and_flat(rng, 0.6)
    once = found(noisy, fitted, everything(), UNIT)
    more = found(16 * noisy, 16 * fitted, everything(), 16 * UNIT)
    np.testing.assert_allclose(more / 16, once, atol=1e-5)


def test_pixels_that_do_not_count_do_not(rng):
    """Not finite, or of no weight."""
    noisy, fitted, _ = noisy_and_flat(rng, 0.6)
    weight, broken = everything(), noisy.copy()
    broken[11, 12], weight[20, 30], broken[20, 30] = np.nan, 0, 1e6
    result = found(broken, fitted, weight, UNIT)
    assert np.isfinite(result).all() and np.max(result) < 3


def test_darkness_has_no_detail():
    dark = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    assert np.all(found(dark, dark, everything(), 0 * UNIT) == 0)


def test_it_is_told_from_nearby_alone(rng):
    noisy, fitted, _ = noisy_and_flat(rng, 0.6)
    cut = 2 * detail.BLOCK
    whole, part = (
        found(a, b, c, UNIT)
        for a, b, c in (
            (noisy, fitted, everything()),
            (noisy[:, cut:], fitted[:, cut:], everything()[:, cut:]),
        )
    )
    near = detail.REACH
    np.testing.assert_allclose(whole[:, cut + near :], part[:, near:], atol=1e-5)
