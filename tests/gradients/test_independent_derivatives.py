"""Derivatives of FLR against other code and other methods than finite differences of itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jax.test_util import check_grads

from experiments.stability import solvers
from experiments.stability.cases import make
from experiments.stability.methods import by_numpy
from jflnr.fitting import smape
from jflnr.regression.flr import DEFAULT, FLR, flr


@jax.jit
def _derivative(point, direction):
    return jax.jvp(lambda y, x: flr(y, x, DEFAULT, support=96), point, direction)[1]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("case", ["ordinary", "two equal guides", "guides of 1e-4 and 1e4"])
def test_complex_step_through_an_independent_implementation(rng, case):
    """d f(x) = Im f(x + i h dx) / h, exact to rounding for any tiny h, through plain numpy."""
    made = make(case, 18, 20, np.float64)
    step = 1e-30
    size = np.abs(made.guides).max((0, 1))
    d_target = rng.standard_normal(made.target.shape)
    d_guides = rng.standard_normal(made.guides.shape) * size
    moved = made._replace(
        target=made.target + 1j * step * d_target, guides=made.guides + 1j * step * d_guides
    )
    truth = by_numpy(solvers.exact, moved, np.complex128).imag / step
    with jax.enable_x64(True):
        arrays = jnp.asarray(made.target), jnp.asarray(made.guides)
        ours = _derivative(arrays, (jnp.asarray(d_target), jnp.asarray(d_guides)))
    np.testing.assert_allclose(ours, truth, atol=1e-10 * np.abs(truth).max())


PROBLEMS = st.fixed_dictionaries(
    {
        "size": st.tuples(st.integers(1, 9), st.integers(1, 9)),
        "guides": st.integers(0, 3),
        "channels": st.integers(1, 3),
        "block": st.integers(1, 4),
        "sigma": st.floats(0.5, 20),
        "seed": st.integers(0, 2**32 - 1),
    }
)


def derivatives_agree(problem):
    """Forward mode against Richardson's extrapolation, reverse mode against forward mode."""
    rng = np.random.default_rng(problem["seed"])
    size, block = problem["size"], problem["block"]
    parameters = FLR(problem["sigma"], 1e-3, 1e-2)
    with jax.enable_x64(True):

        def normal(count):
            return jnp.asarray(rng.standard_normal((*size, count)))

        def whole(arrays):
            return flr(*arrays, block=block, support=8)

        @jax.jit
        def both(point, direction, back):
            _, forward = jax.jvp(whole, (point,), (direction,))
            return forward, jax.vjp(whole, point)[1](back)[0]

        evaluate = jax.jit(whole)

        counts = problem["channels"], problem["guides"]
        point = (*(normal(n) for n in counts), jax.tree.map(jnp.float64, parameters))
        numbers = Parameters(*map(jnp.float64, rng.standard_normal(3)))
        direction = (*(normal(n) for n in counts), numbers)

        def central(h):
            ends = [jax.tree.map(lambda a, d, s=s: a + s * d, point, direction) for s in (h, -h)]
            return (evaluate(ends[0]) - evaluate(ends[1])) / (2 * h)

        richardson = (4 * central(1e-4) - central(2e-4)) / 3
        back = normal(problem["channels"])
        forward, gradient = both(point, direction, back)
        by_reverse = sum(
            np.vdot(g, d)
            for g, d in zip(jax.tree.leaves(gradient), jax.tree.leaves(direction), strict=True)
        )
    scale = np.abs(forward).max() + 1e-6
    np.testing.assert_allclose(forward, richardson, atol=1e-7 * scale)
    np.testing.assert_allclose(by_reverse, np.vdot(back, forward), atol=1e-9 * scale * back.size)


@settings(max_examples=2, deadline=None, derandomize=True, database=None)
@given(PROBLEMS)
def test_any_shape(problem):
    derivatives_agree(problem)


@pytest.mark.slow
@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(PROBLEMS)
def test_many_shapes(problem):
    derivatives_agree(problem)


def test_smape(rng):
    with jax.enable_x64(True):
        picture, reference = (jnp.asarray(rng.random((4, 5, 3))) + k for k in (0, 0.1))
        check_grads(smape, (picture, reference), order=1, modes=("fwd", "rev"), eps=1e-6)


@pytest.mark.parametrize("reference", [0.0, 1e-20, 1.0])
def test_smape_where_it_has_a_corner(reference):
    """Where the two agree, also in the black, the derivative is that of one side."""
    same = jnp.zeros((2, 2, 3)) + reference
    value, gradient = jax.value_and_grad(smape)(same, same)
    assert value == 0
    slope = 1 / (same.size * max(2.001 * reference, 1e-12))
    assert (np.abs(gradient) <= 1.001 * slope).all()
