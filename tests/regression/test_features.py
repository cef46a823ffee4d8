"""What must hold of the filter for the features of a path tracer."""

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.images.noisy_guides import antialiased
from jflnr.regression import features
from jflnr.regression.features import coverage, filter_features

filtered = jax.jit(filter_features)


def edge(rng, samples=None, size=24):
    """Coverage of the half-plane right of a slanted line, `(H, W, 1)`: exact, or of few samples."""
    count = samples or 4096
    y, x = np.mgrid[:size, :size][..., None] + rng.random((2, size, size, count))
    return np.float32(np.mean(x + 0.3 * y > 0.6 * size, axis=-1, keepdims=True))


def test_an_edge_of_few_samples_comes_nearer_to_its_coverage(rng):
    noisy, exact = edge(rng, 4), edge(rng)
    (result,) = filtered((noisy,), (noisy,))
    assert np.mean((result - exact) ** 2) < 0.5 * np.mean((noisy - exact) ** 2)


def test_more_samples_are_averaged_less(rng):
    noisy = edge(rng, 4)
    few, many = (filtered((noisy,), (noisy,), samples)[0] for samples in (1.0, 64.0))
    assert np.mean((many - noisy) ** 2) < 0.5 * np.mean((few - noisy) ** 2)


def blurred(image):
    for axis in (0, 1):
        padded = np.pad(image, [(1, 1) if a == axis else (0, 0) for a in range(image.ndim)], "edge")
        three = [np.take(padded, range(k, k + image.shape[axis]), axis) for k in range(3)]
        image = (three[0] + 2 * three[1] + three[2]) / 4
    return image


def test_the_average_is_that_of_its_formula(rng):
    """Pixel by pixel in float64: the weight is one of the gradients, the features and the step."""
    steer, follow = rng.random((2, 9, 11, 2))
    near = blurred(steer)
    down, right = (
        np.diff(
            np.pad(near, [(1, 1) if a == axis else (0, 0) for a in range(3)], "edge"), axis=axis
        )
        for axis in (0, 1)
    )
    down, right = (down[1:] + down[:-1]) / 2, (right[:, 1:] + right[:, :-1]) / 2
    products = [np.sum(a * b, axis=-1) for a, b in ((down, down), (down, right), (right, right))]
    across = blurred(blurred(blurred(np.stack(products, axis=-1))))
    expected, reach = np.zeros_like(follow), features.REACH
    alike = features.VARIANCE / 9 + features.LEAST
    for y, x in np.ndindex(9, 11):
        total = 0.0
        for v in range(max(y - reach, 0), min(y + reach + 1, 9)):
            for u in range(max(x - reach, 0), min(x + reach + 1, 11)):
                step = np.array([(v - y) ** 2, 2 * (v - y) * (u - x), (u - x) ** 2])
                apart = across[y, x] @ step / alike
                apart += (step[0] + step[2]) / features.WIDTH**2
                apart += np.sum((near[v, u] - near[y, x]) ** 2) / (features.NEAR**2 * alike)
                total += np.exp(-apart / 2)
                expected[y, x] += np.exp(-apart / 2) * follow[v, u]
        expected[y, x] /= total
    (result,) = filtered((np.float32(steer),), (np.float32(follow),), 9.0)
    np.testing.assert_allclose(result, expected, rtol=2e-5)


def test_the_share_of_a_lamp_does_not_depend_on_its_light(rng):
    share = edge(rng, 4)
    shown = coverage(25 * share, 0.5)
    np.testing.assert_allclose(shown, coverage(50 * share, 0.5), rtol=1e-5)
    np.testing.assert_allclose(shown[:, 12:][share[:, 12:] == 1], 1, atol=0.3)
    np.testing.assert_array_equal(coverage(0.4 * share, 0.5), 0.8 * share)


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
