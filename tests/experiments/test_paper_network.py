"""The paper's network: its shape, its range, and what must hold of the denoiser around it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.peers import paper_network as paper
from jflnr.regression.flr import DEFAULT, flr
from tests.network.conftest import scene_of

WIDTHS = (2, 3, 4)


@pytest.fixture(scope="module")
def params():
    return paper.init(jax.random.key(0), 8, 5, WIDTHS)


@pytest.mark.parametrize("size", [(12, 16), (7, 9)])
def test_two_sets_of_guides_between_0_and_1(params, rng, size):
    x = jnp.asarray(rng.standard_normal((*size, 8)), jnp.float32)
    for guides in paper.apply(params, x):
        assert guides.shape == (*size, 5)
        assert guides.min() >= 0 and guides.max() <= 1


def test_the_layers_are_those_of_section_3_3(params):
    """3x3 and 1x1 at both ends; two 3x3 per block, the skip joined to what comes from below."""
    shapes = {name: value.shape for name, value in params.items() if value.ndim == 4}
    assert shapes["in3"] == (3, 3, 8, 2) and shapes["in1"] == (1, 1, 2, 2)
    assert shapes["encode1b"] == (3, 3, 3, 4) and shapes["decode1a"] == (3, 3, 3 + 4, 3)
    assert shapes["out3"] == (3, 3, 2, 2) and shapes["out1"] == (1, 1, 2, 10)


def test_scales_with_the_light_and_is_flr_on_the_guides_it_makes(params):
    target, guides = (jnp.asarray(a[:24, :32]) for a in scene_of(37, 50))
    once = paper.flnr_of_paper(target, guides, params, DEFAULT, block=8, support=24)
    more = paper.flnr_of_paper(100 * target, guides, params, DEFAULT, block=8, support=24)
    np.testing.assert_allclose(more, 100 * once, rtol=1e-3, atol=1e-2)
    read = jnp.concatenate([guides, jnp.log1p(target / target.mean())], axis=-1)
    model, mapped = paper.apply(params, read)
    plain = flr(target, model, DEFAULT, guides_map=mapped, block=8, support=24)
    np.testing.assert_allclose(once, plain, rtol=1e-4, atol=1e-5)


def test_network_and_regularisation_are_learned_together(params):
    """A step against the gradient brings the light nearer to what it should be."""
    target, guides = (jnp.asarray(a[:24, :32]) for a in scene_of(37, 50))
    wanted = jnp.mean(target, axis=(0, 1)) * (1 + guides[..., :1])

    def loss(both):
        light = paper.flnr_of_paper(target, guides, *both, block=8, support=24)
        return jnp.mean((light - wanted) ** 2)

    both = (params, jax.tree.map(jnp.float32, DEFAULT))
    before, gradient = jax.value_and_grad(loss)(both)
    for slope in jax.tree.leaves(gradient[1]):
        assert np.isfinite(slope) and slope != 0
    length = jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(gradient)))
    after = loss(jax.tree.map(lambda value, slope: value - 1e-2 * slope / length, both, gradient))
    assert after < before
