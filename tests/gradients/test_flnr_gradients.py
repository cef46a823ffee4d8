"""Derivatives of the network and of all that it steers, against finite differences in float64."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jflnr.network import features, loss, regression, unet
from jflnr.network.examples import Example
from jflnr.regression.moments import collect

GUIDES = 5


def check(function, *arguments):
    with jax.enable_x64(True):
        arguments = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), arguments)
        check_grads(jax.jit(function), arguments, order=1, modes=("rev",), eps=1e-5)


@pytest.fixture
def example(rng):
    """24 x 32 pixels with made-up moments."""

    def noise(*shape):
        return rng.standard_normal(shape)

    shift = 0.3 * noise(GUIDES)
    target, guides = rng.exponential(1.3, (24, 32, 3)), 0.3 * noise(24, 32, GUIDES)
    with jax.enable_x64(True):
        moments = collect(jnp.asarray(target), jnp.asarray(guides), shift, regression.BLOCK)
    known = regression.Prepared(
        x=noise(6 // 2, 8 // 2, features.COUNT),
        steered=regression.Steered(
            moments=np.asarray(moments),
            noise=rng.uniform(0.5, 1, (1, 6, 8)),
            factor=rng.uniform(0.9, 1.1, (6, 8)),
            mean=np.array(1.3),
            dark=np.array(0.04),
        ),
        unit=np.array(2.0),
    )
    return Example(
        prepared=known,
        shift=shift,
        guides=guides,
        albedo=rng.uniform(0.2, 0.8, (24, 32, 3)),
        target=rng.uniform(0.2, 0.6, (24, 32, 3)),
        exposure=np.array(0.3),
    )


@pytest.fixture
def params(rng):
    start = regression.init(jax.random.key(0), (4, 4, 4))
    return {name: value + 0.1 * rng.standard_normal(value.shape) for name, value in start.items()}


def test_network(rng):
    params = unet.init(jax.random.key(0), 3, (4, 4), (2,))
    params = {
        name: value + 0.1 * rng.standard_normal(value.shape) for name, value in params.items()
    }
    check(lambda p, x: unet.apply(p, x)[0], params, rng.standard_normal((5, 6, 3)))


def test_models_by_the_weights(params, example):
    known, shift = example.prepared, example.shift

    def models(p, moments):
        says = regression.heard(p, known.x, known.size)
        return regression.finish(says, known.steered._replace(moments=moments), shift)

    check(models, params, known.steered.moments)


def test_what_training_minimises(params, example):
    # By the weights: pixels of the frame are taken in float32.
    check(lambda p: loss.to_reference(p, example), params)
