"""Gradients by input and parameters are finite in every case of the atlas."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.stability import SIZE
from experiments.stability.cases import CASES, make
from jflnr.network.flnr import FLNR, flnr
from jflnr.network.weights import shipped
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from jflnr.regression.flr import DEFAULT, flr

FIVE_GUIDES = [case for case in CASES if "16" not in case]


@functools.cache
def gradient(method):
    def mean(target, guides, numbers, usable, unit):
        # Of the light relative to the input: of light near the type's maximum a derivative that is
        # above 1 is beyond it.
        light = method(target, guides, numbers, weight=usable) / unit
        ramp = jnp.linspace(-1, 1, light.size).reshape(light.shape)
        return jnp.mean(light * ramp)

    return jax.jit(jax.grad(mean, argnums=(0, 1, 2)))


def is_finite(method, case, numbers, channels):
    made = make(case, *SIZE, np.float32)
    arrays = made.target[..., channels], made.guides, jax.tree.map(np.float32, numbers)
    unit = max(np.abs(made.target).max(), np.finfo(np.float32).tiny)
    found = gradient(method)(*jax.tree.map(jnp.asarray, arrays), made.usable, unit)
    for leaf in jax.tree.leaves(found):
        assert np.isfinite(leaf).all()


def wide_flr(*arguments, **options):
    return flr(*arguments, support=96, **options)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize("case", FIVE_GUIDES)
def test_flr(case):
    is_finite(wide_flr, case, DEFAULT, np.array([0, 1]))


@pytest.mark.slow  # compiles long
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_flr_of_16_guides():
    is_finite(wide_flr, "16 guides, rank 5", DEFAULT, np.array([0, 1]))


@pytest.mark.slow  # compiles long
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize("case", FIVE_GUIDES)
def test_flr_adaptive(case):
    is_finite(flr_adaptive, case, AdaptiveFLR(), np.array([0]))


@pytest.mark.slow  # compiles long
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize("case", FIVE_GUIDES)
def test_flnr(case):
    is_finite(flnr, case, FLNR(params=shipped("flnr-small")), np.array([0, 0, 0]))


@pytest.mark.parametrize(
    ("method", "numbers"),
    [
        (wide_flr, DEFAULT),
        (flr_adaptive, AdaptiveFLR()),
        (flr_adaptive, AdaptiveFLR(sigma=0.85)),
        (flr_adaptive, AdaptiveFLR(sigma=0.4)),
    ],
)
def test_far_from_all_light(method, numbers):
    """Windows that reach no usable pixel at all, as in a wide sky."""
    made = make("ordinary", 16, 240, np.float32)
    usable = np.arange(240) < 40
    arrays = made.target[..., :1], made.guides, jax.tree.map(np.float32, numbers)
    weight = jnp.asarray(np.broadcast_to(usable, (16, 240)))
    found = gradient(method)(*jax.tree.map(jnp.asarray, arrays), weight, 1)
    for leaf in jax.tree.leaves(found):
        assert np.isfinite(leaf).all()
    assert np.any(found[0][:, usable])
    np.testing.assert_array_equal(found[0][:, ~usable], 0)
