"""Derivatives of the network and of all that it steers, against finite differences in float64."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jflnr.flnr import features, loss, regression, unet
from jflnr.flnr.examples import Example

GRIDS = [(6, 8), (3, 4), (2, 2), (1, 1)]
GUIDES = 5


def check(function, *arguments):
    with jax.enable_x64(True):
        arguments = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), arguments)
        check_grads(jax.jit(function), arguments, order=1, modes=("rev",), eps=1e-5)


@pytest.fixture
def example(rng):
    """24 x 32 pixels with made-up fits."""

    def noise(*shape):
        return rng.standard_normal(shape)

    coefficients = [0.2 * noise(GUIDES + 1, 3, *grid) for grid in GRIDS]
    coefficients[-1][0] += 2
    known = regression.Prepared(
        x=noise(*GRIDS[1], features.COUNT),
        coarsest=coefficients[3],
        differences=(coefficients[2], coefficients[1], coefficients[0]),
        shares=tuple(rng.uniform(size=grid) for grid in GRIDS[2::-1]),
        guides=np.concatenate([np.ones((1, *GRIDS[0])), 0.1 * noise(GUIDES, *GRIDS[0])]),
        factor=rng.uniform(0.9, 1.1, GRIDS[0]),
        mean=np.array(1.3),
    )
    return Example(
        prepared=known,
        shift=noise(GUIDES),
        guides=noise(24, 32, GUIDES),
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
    check(lambda p, known: regression.finish(p, known), params, example.prepared)


def test_what_training_minimises(params, example):
    # By the weights: pixels of the frame are taken in float32.
    check(lambda p: loss.to_reference(p, example), params)
