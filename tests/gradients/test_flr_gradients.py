"""Derivatives of every step of FLR against finite differences, closed forms and one another."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jflnr.regression.apply import apply
from jflnr.regression.blur import blur, gaussian_taps
from jflnr.regression.flr import FLR, flr
from jflnr.regression.moments import collect
from jflnr.regression.solve import block_inverse_solve, cholesky_solve, solve

PARAMETERS = FLR(sigma=5.0, eps=1e-2, eps_prime=1e-2)
SHIFT = np.array([0.1, -0.2])


@pytest.fixture
def images(rng):
    """A target (6, 7, 2), guides (6, 7, 2) and their moments in blocks of 2, as numpy."""
    x, y = rng.standard_normal((6, 7, 2)), rng.standard_normal((6, 7, 2))
    with jax.enable_x64(True):
        moments = np.asarray(collect(jnp.asarray(y), jnp.asarray(x), jnp.asarray(SHIFT), 2))
    return y, x, moments


def check(function, *arguments):
    """First order, forward and reverse, in float64."""
    with jax.enable_x64(True):
        arguments = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), arguments)
        check_grads(jax.jit(function), arguments, order=1, modes=("fwd", "rev"), eps=1e-5)


def blurred(moments):
    with jax.enable_x64(True):
        return np.asarray(blur(jnp.asarray(moments), 1.5, 3))


def test_moments(images):
    y, x, _ = images
    check(lambda t, g: collect(t, g, jnp.asarray(SHIFT), 2), y, x)


def test_blur_by_its_input_and_its_width(images):
    check(lambda m, s: blur(m, s, 3), images[2], 1.3)


@pytest.mark.parametrize("solver", [cholesky_solve, block_inverse_solve])
def test_solvers(rng, solver):
    factor = rng.standard_normal((4, 4))
    matrix = (factor @ factor.T + np.eye(4))[..., None, None] / 5
    right = rng.standard_normal((4, 2, 1, 1))
    # Perturbed symmetrically, since the solvers read only half of the matrix.
    check(lambda m, b: solver((m + m.swapaxes(0, 1)) / 2, b), matrix, right)


@pytest.mark.parametrize("solver", ["cholesky", "block-inverse"])
def test_normalised_solve_by_moments_and_regularisation(images, solver):
    moments = blurred(images[2])
    check(lambda m, p: solve(m, jnp.asarray(SHIFT), p, 2, solver), moments, PARAMETERS)


def test_apply(rng, images):
    coefficients = rng.standard_normal((3, 2, 3, 4))
    check(lambda c, g: apply(c, g, jnp.asarray(SHIFT), 2), coefficients, images[1])


def test_whole_by_image_guides_and_parameters(images):
    y, x, _ = images
    check(lambda t, g, p: flr(t, g, p, block=2, support=12), y, x, PARAMETERS)


def test_upsampling_by_map_guides(rng, images):
    y, x, _ = images
    fine = rng.standard_normal((12, 14, 2))
    check(lambda t, g: flr(t, x, PARAMETERS, block=2, support=12, guides_map=g), y, fine)


def test_second_order_by_parameters(images):
    y, x, _ = images
    with jax.enable_x64(True):
        fit = lambda p: jnp.sum(flr(jnp.asarray(y), jnp.asarray(x), p, block=2, support=12) ** 2)
        parameters = jax.tree.map(jnp.float64, PARAMETERS)
        check_grads(jax.jit(fit), (parameters,), order=2, modes=("rev",), eps=1e-4)


def test_width_against_the_closed_form(images):
    """d taps / d sigma = taps * (k^2 - mean k^2) / sigma^3."""
    with jax.enable_x64(True):
        taps = np.asarray(gaussian_taps(1.7, 4, jnp.float64))
        ours = jax.jacfwd(lambda s: gaussian_taps(s, 4, jnp.float64))(1.7)
    k2 = np.arange(-4, 5) ** 2
    np.testing.assert_allclose(ours, taps * (k2 - np.sum(taps * k2)) / 1.7**3, atol=1e-12)


def test_solve_against_implicit_differentiation(rng):
    """For A x = b: dx = A^-1 (db - dA x), with numpy's solve."""
    factor = rng.standard_normal((5, 5))
    matrix, right = factor @ factor.T / 5 + np.eye(5), rng.standard_normal((5, 2))
    d_matrix, d_right = rng.standard_normal((5, 5)), rng.standard_normal((5, 2))
    d_matrix += d_matrix.T
    planes = lambda a: jnp.asarray(a)[..., None, None]
    with jax.enable_x64(True):
        _, ours = jax.jvp(
            cholesky_solve, (planes(matrix), planes(right)), (planes(d_matrix), planes(d_right))
        )
    x = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(
        ours[..., 0, 0], np.linalg.solve(matrix, d_right - d_matrix @ x), atol=1e-10
    )


def test_float32_gradients_are_those_of_float64(images):
    y, x, _ = images

    def loss(t, p):
        return jnp.sum(flr(t, jnp.asarray(x, t.dtype), p, block=2, support=12) ** 2)

    grad = jax.jit(jax.grad(loss, argnums=(0, 1)))
    single = grad(jnp.float32(y), jax.tree.map(jnp.float32, PARAMETERS))
    with jax.enable_x64(True):
        double = grad(jnp.float64(y), jax.tree.map(jnp.float64, PARAMETERS))
    for a, b in zip(jax.tree.leaves(single), jax.tree.leaves(double), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-4)


def test_vmap_of_grad_is_grad_of_vmap(images):
    y, x, _ = images
    one = lambda t: jnp.sum(flr(t, jnp.float32(x), PARAMETERS, block=2, support=12) ** 2)
    batch = jnp.float32(np.stack([y, 2 * y, -y]))
    inner = jax.jit(jax.vmap(jax.grad(one)))(batch)
    outer = jax.jit(jax.grad(lambda b: jnp.sum(jax.vmap(one)(b))))(batch)
    np.testing.assert_allclose(inner, outer, rtol=1e-5, atol=1e-5)


HARD = {
    "constant guide": lambda y, x: (y, np.ones_like(x)),
    "zero guides": lambda y, x: (y, 0 * x),
    "two equal guides": lambda y, x: (y, x[..., :1].repeat(2, -1)),
    "guides apart by 1e-6": lambda y, x: (y, x[..., :1] + [0, 1e-6]),
    "far from the origin": lambda y, x: (y, x + 1e4),
    "small and large": lambda y, x: (y, x * [1e-4, 1e4]),
    "black": lambda y, x: (0 * y, x),
    "one lit pixel": lambda y, x: (y * (np.indices(y.shape[:2]).sum(0) == 0)[..., None], x),
    "not a number": lambda y, x: (np.where(y > 1, np.nan, y), x),
    "nothing usable": lambda y, x: (y * np.nan, x),
}


@pytest.mark.parametrize("case", HARD)
@pytest.mark.parametrize("solver", ["cholesky", "block-inverse"])
def test_gradients_are_finite_in_hard_cases(images, case, solver):
    y, x = (np.float32(a) for a in HARD[case](*images[:2]))
    usable = np.isfinite(y)
    value, grads = _hard(solver)(y, x, PARAMETERS)
    assert np.isfinite(value)
    by_target, by_guides, by_parameters = grads
    assert np.isfinite(by_target[usable]).all() and np.isfinite(by_guides).all()
    assert all(np.isfinite(g) for g in by_parameters)


@functools.cache
def _hard(solver):
    """One compilation for all cases."""

    def loss(t, g, p):
        return jnp.sum(flr(t, g, p, block=2, support=12, solver=solver) ** 2)

    return jax.jit(jax.value_and_grad(loss, argnums=(0, 1, 2)))


@jax.custom_jvp
def scaled(x):
    return x**2


@scaled.defjvp
def _scaled_jvp(primals, tangents):
    return scaled(primals[0]), 2.02 * primals[0] * tangents[0]


@jax.custom_vjp
def forgetful(a, b):
    return a * b + a


def _forgetful_backward(residual, cotangent):
    a, b = residual
    return cotangent * b, cotangent * a


forgetful.defvjp(lambda a, b: (forgetful(a, b), (a, b)), _forgetful_backward)


def test_the_check_catches_a_scaled_cotangent_and_a_missing_term():
    with pytest.raises(AssertionError):
        check(scaled, 1.5)
    with jax.enable_x64(True), pytest.raises(AssertionError):
        check_grads(
            forgetful, (np.float64(1.5), np.float64(0.7)), order=1, modes=("rev",), eps=1e-5
        )
