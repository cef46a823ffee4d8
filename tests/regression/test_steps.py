"""Each step alone: its definition, its adjoint."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.regression.apply import apply
from jflnr.regression.blur import blur, gaussian_taps
from jflnr.regression.elimination import block_inverse_solve, cholesky_solve, eliminate
from jflnr.regression.flr import FLR, flr
from jflnr.regression.moments import centre, collect, index_xx, index_xy, plane_count


@pytest.mark.parametrize(("height", "width", "block"), [(16, 24, 8), (13, 10, 4), (7, 5, 1)])
def test_moments_are_block_means_of_products(rng, height, width, block):
    x, y = rng.standard_normal((height, width, 3)), rng.standard_normal((height, width, 2))
    shift = np.array([0.5, -1.0, 2.0])
    with jax.enable_x64(True):
        ours = np.asarray(collect(*map(jnp.asarray, (y, x, shift)), block))
    regressors = np.concatenate([np.ones((height, width, 1)), x - shift], -1)
    assert ours.shape == (plane_count(3, 2), -(-height // block), -(-width // block))
    for r, c in np.ndindex(ours.shape[1:]):
        place = np.s_[r * block : (r + 1) * block, c * block : (c + 1) * block]
        z, t = regressors[place].reshape(-1, 4), y[place].reshape(-1, 2)
        xx, xy = z.T @ z / block**2, z.T @ t / block**2
        for i in range(4):
            for j in range(4):
                np.testing.assert_allclose(ours[index_xx(i, j), r, c], xx[i, j], atol=1e-12)
            for k in range(2):
                np.testing.assert_allclose(ours[index_xy(i, k, 3, 2), r, c], xy[i, k], atol=1e-12)


def test_centre_ignores_what_is_not_finite():
    guides = np.full((40, 50, 2), 7.0, np.float32)
    guides[::3, :, 0] = np.nan
    guides[:, :, 1] = np.inf
    np.testing.assert_allclose(centre(jnp.asarray(guides)), [7, 0], rtol=1e-5)


@pytest.mark.parametrize("sigma", [5.0, 40.0])
def test_the_window_reaches_as_far_where_its_width_is_traced(rng, sigma):
    y, x = rng.random((90, 50, 3), np.float32), rng.random((90, 50, 2), np.float32)
    plain = flr(y, x, FLR(sigma))
    traced = jax.jit(lambda method: flr(y, x, method))(FLR(sigma))
    several = jax.vmap(lambda s: flr(y, x, FLR(s)))(jnp.array([1.0, sigma]))[1]
    for found in (traced, several):
        np.testing.assert_allclose(found, plain, rtol=1e-4, atol=1e-5)


def test_sizes_far_beyond_the_frame_are_clamped(rng):
    y, x = rng.random((90, 50, 3), np.float32), rng.random((90, 50, 2), np.float32)
    found, wanted = flr(y, x, block=10**9, support=10**9), flr(y, x, block=128)
    np.testing.assert_allclose(found, wanted, rtol=1e-4)


def test_taps_are_a_gaussian_and_vanishing_width_is_the_identity():
    taps = gaussian_taps(1.5, 6, jnp.float32)
    assert np.isclose(taps.sum(), 1)
    assert np.isclose(taps[6 + 3] / taps[6], np.exp(-0.5 * 4), rtol=1e-5)
    np.testing.assert_array_equal(gaussian_taps(0.0, 2, jnp.float32), [0, 0, 1, 0, 0])
    assert np.isfinite(jax.grad(lambda s: gaussian_taps(s, 2, jnp.float32)[1])(0.0))


def test_blur_is_the_separable_convolution(rng):
    planes = rng.standard_normal((2, 9, 7))
    with jax.enable_x64(True):
        ours = blur(jnp.asarray(planes), 1.3, 4)
    taps = np.exp(-0.5 * (np.arange(-4, 5) / 1.3) ** 2)
    taps /= taps.sum()
    for plane, out in zip(planes, np.asarray(ours), strict=True):
        rows = np.stack([np.convolve(column, taps)[4:-4] for column in plane.T], 1)
        truth = np.stack([np.convolve(row, taps)[4:-4] for row in rows])
        np.testing.assert_allclose(out, truth, atol=1e-12)


def adjoint_error(linear, example, rng):
    """|y . A x - A^T y . x| relative to its size."""
    out = jax.eval_shape(linear, example)
    _, transpose = jax.vjp(linear, example)
    y = rng.standard_normal(out.shape)
    left = jnp.vdot(y, linear(example))
    right = jnp.vdot(transpose(jnp.asarray(y))[0], example)
    return abs(left - right) / abs(left)


def test_linear_steps_have_their_adjoint(rng):
    with jax.enable_x64(True):
        x = jnp.asarray(rng.standard_normal((13, 18, 2)))
        y = jnp.asarray(rng.standard_normal((13, 18, 3)))
        shift = jnp.zeros(2)
        planes = jnp.asarray(rng.standard_normal((4, 6, 5)))
        coefficients = jnp.asarray(rng.standard_normal((3, 3, 4, 5)))
        target_moments = lambda t: collect(t, x, shift, 4)[index_xy(0, 0, 2, 3) :]
        assert adjoint_error(target_moments, y, rng) < 1e-12
        assert adjoint_error(lambda m: blur(m, 1.5, 4), planes, rng) < 1e-12
        assert adjoint_error(lambda c: apply(c, x, shift, 4), coefficients, rng) < 1e-12


@pytest.mark.parametrize("solver", [cholesky_solve, block_inverse_solve, eliminate])
@pytest.mark.parametrize("size", [0, 1, 2, 3, 5, 8, 16])
def test_solvers_against_numpy(rng, solver, size):
    factor = rng.standard_normal((6, size, size + 2))
    matrix = factor @ factor.swapaxes(1, 2) + 0.1 * np.eye(size)
    root = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
    matrix /= root[:, :, None] * root[:, None]
    right = rng.standard_normal((6, size, 3))
    planes = lambda a: jnp.asarray(np.moveaxis(a, 0, -1)[..., None])
    with jax.enable_x64(True):
        ours = np.asarray(solver(planes(matrix), planes(right)))[..., 0]
    np.testing.assert_allclose(np.moveaxis(ours, -1, 0), np.linalg.solve(matrix, right), atol=1e-9)
