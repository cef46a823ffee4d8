"""What must hold of the filter for the features of a path tracer."""

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.images.noisy_guides import antialiased
from jflnr.regression.features import filter_features

filtered = jax.jit(filter_features)


def edge(rng, samples=None, size=24):
    """Coverage of the half-plane right of a slanted line, `(H, W, 1)`: exact, or of few samples."""
    count = samples or 4096
    y, x = np.mgrid[:size, :size][..., None] + rng.random((2, size, size, count))
    return np.float32(np.mean(x + 0.3 * y > 0.6 * size, axis=-1, keepdims=True))


def test_an_edge_of_few_samples_comes_nearer_to_its_coverage(rng):
    noisy, exact = edge(rng, 4), edge(rng)
    (result,) = filtered((noisy,), (noisy,))
    assert np.mean((result - exact) ** 2) < 0.7 * np.mean((noisy - exact) ** 2)


def test_what_is_constant_stays(rng):
    constant = jnp.full((9, 13, 3), 0.7)
    (result,) = filtered((edge(rng, 4, 13)[:9],), (constant,))
    np.testing.assert_allclose(result, constant, rtol=1e-5)


def test_surfaces_that_differ_much_stay_apart():
    left = np.arange(20) < 10
    sides = np.broadcast_to(left, (12, 20))[..., None].astype(np.float32)
    (result,) = filtered((10 * sides,), (sides,))
    np.testing.assert_allclose(result, sides, atol=1e-3)


def test_a_follower_may_have_any_unit_and_does_not_steer(rng):
    noisy = edge(rng, 4)
    together = filtered((noisy,), (noisy, 1000 * noisy))
    np.testing.assert_allclose(together[1], 1000 * together[0], rtol=1e-4)


def test_a_pixel_that_is_not_finite_gets_its_neighbours(rng):
    noisy = edge(rng, 4)
    broken = noisy.copy()
    broken[5, 6] = np.nan
    (result,) = filtered((broken,), (broken,))
    assert np.isfinite(result).all()
    assert noisy[4:7, 5:8].min() <= result[5, 6, 0] <= noisy[4:7, 5:8].max()


def test_normals_of_several_samples_are_told_from_those_of_one(rng):
    share = edge(rng, 4)
    mixed = np.concatenate([share, 0 * share, 1 - share], axis=-1)
    assert antialiased(mixed)
    assert not antialiased(np.round(mixed))
    assert not antialiased(np.zeros((8, 8, 3)))
