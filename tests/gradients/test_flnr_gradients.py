"""Derivatives of the network and of what training minimises, against finite differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jflnr.network import flnr, loss
from jflnr.network.examples import Example
from jflnr.network.features import Read


def check(function, *arguments):
    with jax.enable_x64(True):
        arguments = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), arguments)
        # LeakyReLU has corners: a step must not reach the next one.
        check_grads(jax.jit(function), arguments, order=1, modes=("rev",), eps=1e-7, rtol=1e-4)


@pytest.fixture
def example(rng):
    """16 x 24 pixels, all of which count."""
    size = 16, 24
    light, noisy = rng.exponential(1.3, (2, *size, 3))
    one = [rng.uniform(0.1, 1, (*size, 1)) for _ in range(3)]
    normal = rng.standard_normal((*size, 3))
    read = Read(light, noisy, one[0], normal, *one[1:], np.ones((*size, 1)))
    albedo, target = rng.uniform(0.2, 0.8, (2, *size, 3))
    return Example(read, albedo, target, exposure=np.array(0.3), error=np.array(0.01))


@pytest.fixture
def params(rng):
    start = flnr.init(jax.random.key(0), (4, 4, 4))
    return {name: value + 0.1 * rng.standard_normal(value.shape) for name, value in start.items()}


def test_network_by_weights_and_light(params, example):
    def said(params, light):
        return flnr.said(params, example.read._replace(light=light))

    check(said, params, example.read.light)


def test_what_training_minimises(params, example):
    check(lambda p: loss.relative_error(p, example), params)
