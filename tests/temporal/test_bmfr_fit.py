"""Phase II of BMFR against least squares in float64, block by block."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.bmfr.fit import OFFSETS, grid_offset, mirrored, triangle, uniform
from jflnr.temporal import bmfr, bmfr_fit
from tests.temporal.bmfr_shot import shot

fit = jax.jit(bmfr_fit.fit, static_argnames=("block", "squares"))


def pcg(value):
    state = value * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return (word >> np.uint32(22)) ^ word


def hashed(number, counter):
    bits = pcg(np.uint32(counter) ^ pcg(np.array([number], np.uint32)))
    return (bits >> np.uint32(9)) / 2**22 - 1


def unit(x, there, least=0.0):
    low, high = x[there].min(0), x[there].max(0)
    return np.where(high - low > least, 2 * (x - low) / np.where(high > low, high - low, 1) - 1, 0)


def oracle(light, features, surface, number, offset, block, noise, squares):
    """The same by `numpy.linalg.lstsq`, one block after the other."""
    size = light.shape[:2]
    margins = [(o, block + -n % block - o) for n, o in zip(size, offset, strict=True)]
    pad = lambda image: np.pad(np.float64(image), [*margins, (0, 0)], mode="symmetric")
    y, x, there = pad(light), pad(features), pad(surface)[..., 0] > 0
    image = np.zeros(y.shape)
    per_block = block * block * (1 + x.shape[-1] + squares)
    columns = y.shape[1] // block
    for number_of, (top, left) in enumerate(np.ndindex(y.shape[0] // block, columns)):
        place = np.s_[top * block : (top + 1) * block, left * block : (left + 1) * block]
        z, t, on = y[place].reshape(-1, 3), x[place].reshape(block**2, -1), there[place].ravel()
        if not on.any():
            continue
        t = unit(t, on)
        t = np.concatenate(
            [np.ones((block**2, 1)), t, unit(t[:, -squares:] ** 2, on, 1e-3)], axis=1
        )
        t[~on] = 0
        used = on & np.isfinite(z).all(1)
        jitter = noise * hashed(number, number_of * per_block + np.arange(per_block))
        matrix = np.where(used[:, None], t, 0) + jitter.reshape(t.shape)
        alpha = np.linalg.lstsq(matrix, np.where(used[:, None], z, 0))[0]
        image[place] = (t @ alpha).reshape(block, block, 3)
    return image[offset[0] :, offset[1] :][: size[0], : size[1]]


@pytest.mark.parametrize("block", [16, 32, 64])
def test_is_least_squares_in_every_block(block):
    """With planes, sky, lost samples, a displaced grid and borders that cut blocks."""
    frame = shot(1, 50, 71)[0]
    light = frame.indirect.copy()
    light[10:13, 20] = np.nan
    features, surface = np.asarray(bmfr.features(frame)), frame.mask > 0
    for number in (0, 5):
        offset = np.asarray(grid_offset(number, block))
        place = (jnp.int32(number), jnp.asarray(offset))
        ours = fit(light, features, surface, *place, block=block, squares=3)
        truth = oracle(light, features, surface, number, offset, block, 0.01, 3)
        np.testing.assert_allclose(ours, truth, atol=1e-4 * truth.max())


def test_householder_triangle_is_that_of_lapack():
    matrix = np.random.default_rng(0).standard_normal((3, 30, 7))
    with jax.enable_x64(True):
        ours = np.triu(triangle(jnp.asarray(matrix), 5))
    truth = np.linalg.qr(matrix)[1][:, :5]
    # Rows of R are unique but for their sign.
    sign = np.sign(ours.diagonal(axis1=1, axis2=2) / truth.diagonal(axis1=1, axis2=2)[:, :5])
    np.testing.assert_allclose(ours, truth * sign[..., None], atol=1e-12)


@pytest.mark.parametrize("size", [1, 5, 31, 32, 33, 70])
def test_every_grid_covers_each_pixel_once_and_mirrors_the_rest(size):
    for block in (16, 32):
        for offset in sorted({int(at) for at in (OFFSETS * block).flat}):
            covered = np.asarray(mirrored(size, block, offset))
            assert covered.shape == (-(-size // block) + 1, block)
            after = covered.size - size - offset
            padded = np.pad(np.arange(size), (offset, after), mode="symmetric")
            np.testing.assert_array_equal(covered.ravel(), padded)


@pytest.mark.parametrize("block", [16, 32, 64])
def test_sixteen_displacements_all_different_and_within_a_block(block):
    offsets = np.stack([grid_offset(number, block) for number in range(32)])
    assert len({tuple(offset) for offset in offsets}) == 16
    assert (offsets >= 0).all() and (offsets < block).all()
    np.testing.assert_array_equal(offsets[:16], offsets[16:])


def test_noise_is_uniform_and_new_in_every_frame():
    first, second = (np.asarray(uniform(jnp.int32(n), 4, 4, 32, 10)).ravel() for n in (0, 1))
    count = first.size
    for noise in (first, second):
        assert -1 <= noise.min() and noise.max() < 1
        assert abs(noise.mean()) < 4 * np.sqrt(1 / 3 / count)
        assert noise.var() == pytest.approx(1 / 3, rel=0.01)
    assert abs(np.corrcoef(first, second)[0, 1]) < 4 / np.sqrt(count)
    np.testing.assert_allclose(first, hashed(0, np.arange(count)), atol=1e-7)


def test_a_plane_is_nan_without_noise_and_not_with_it():
    """Section 3.4: the features of a plane depend on each other, the back substitution fails."""
    frame = shot(1, 40, 40)[0]
    planes = np.asarray(bmfr.features(frame))
    common = (frame.indirect, planes, frame.mask > 0, jnp.int32(0), jnp.zeros(2, int))
    assert np.isnan(fit(*common, noise=0.0, squares=3)).any()
    assert np.isfinite(fit(*common, noise=0.01, squares=3)).all()


def test_squares_of_two_values_are_left_out():
    """What varies of them is rounding, which would be scaled up to a feature."""
    random = np.random.default_rng(0)
    light = random.exponential(size=(40, 40, 3)).astype(np.float32)
    two = np.float32(np.where(random.uniform(size=(40, 40, 6)) < 0.5, 0.4, 0.7))
    wobbling = np.nextafter(two, random.choice([-1, 1], two.shape), dtype=np.float32)
    one, other = (
        fit(light, x, light[..., :1] >= 0, jnp.int32(0), jnp.zeros(2, int), noise=0.01, squares=3)
        for x in (two, wobbling)
    )
    np.testing.assert_allclose(one, other, atol=1e-4)


def test_few_pixels_keep_their_light():
    light = np.full((40, 40, 3), np.nan, np.float32)
    light[5, 6], light[5, 7], light[38, 39] = 2, 2, 3
    features = np.random.default_rng(0).normal(size=(40, 40, 6)).astype(np.float32)
    surface = np.isfinite(light[..., :1])
    result = np.asarray(
        fit(light, features, surface, jnp.int32(0), jnp.zeros(2, int), noise=0.01, squares=3)
    )
    # The rows of noise alone pull towards 0.
    np.testing.assert_allclose(result[surface[..., 0]], light[surface[..., 0]], rtol=0.05)
    assert not result[~surface[..., 0]].any()
