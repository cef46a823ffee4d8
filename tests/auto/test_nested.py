"""Nested models against a literal refit of each order, in numpy's float64."""

import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.auto.collected import Collected
from jflnr.auto.nested import fit_orders
from jflnr.auto.weights import squared_residual
from jflnr.regression.level import brightness
from jflnr.regression.moments import collect

GROUPS = (3, 1)
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture
def pixels(rng):
    """8 x 8 pixels of one window: guides `(64, 4)` and light `(64, 3)` that depends on them."""
    x = rng.standard_normal((64, 4))
    y = 2 + x @ rng.standard_normal((4, 3)) * 0.3 + 0.5 * rng.standard_normal((64, 3))
    return x, y


def collected(x, y):
    images = (jnp.float32(a.reshape(8, 8, -1)) for a in (y, x))
    planes = collect(*images, jnp.zeros(x.shape[1]), 8, None, brightness(3, jnp.float32))
    return Collected(planes[:-1], planes[-1], jnp.zeros(x.shape[1]), jnp.ones(()))


def orders(x, y, noise):
    c = collected(x, y)
    small = jnp.full((1, 1), 1e-8)
    noise = jnp.full((1, 1), noise)
    return fit_orders(c.moments, c.shift, (small, small), noise, GROUPS, 3)


def refit(x, y):
    """Literal least squares: model `(P, 3)` and the mean squared residual of the brightness."""
    design = np.column_stack([np.ones(len(x)), x])
    model = np.linalg.lstsq(design, y, rcond=None)[0]
    return model, np.mean(((y - design @ model) @ WEIGHTS) ** 2)


def test_without_noise_it_is_the_full_model(pixels):
    found = orders(*pixels, 0.0).coefficients[:, :, 0, 0]
    np.testing.assert_allclose(found, refit(*pixels)[0], atol=1e-4)


def test_in_noise_it_is_the_mean(pixels):
    found = orders(*pixels, 1e6).coefficients[:, :, 0, 0]
    np.testing.assert_allclose(found[0], pixels[1].mean(axis=0), rtol=1e-5)
    np.testing.assert_array_equal(found[1:], 0)


def test_each_group_explains_what_its_refit_explains_more(pixels):
    x, y = pixels
    left = [refit(x[:, :count], y)[1] for count in (0, 3, 4)]
    found = orders(x, y, 0.0).explained[:, 0, 0]
    np.testing.assert_allclose(found, -np.diff(left), rtol=1e-3)


def test_a_group_that_is_noise_leaves_the_model_before_it(pixels):
    x, y = pixels
    explained = orders(x, y, 0.0).explained[:, 0, 0]
    # Between what the second group explains and a third of what the first does.
    y = y - 0.5 * x[:, 3:] @ refit(x, y)[0][4:]
    noise = float(orders(x, y, 0.0).explained[1, 0, 0]) * 1.01
    assert explained[0] > 3 * noise
    found = orders(x, y, noise)
    assert found.shares[1, 0, 0] == 0
    np.testing.assert_array_equal(found.coefficients[4], 0)


def test_residual_from_moments_is_that_of_the_pixels(pixels):
    x, y = pixels
    model = np.array([1.5, 0.2, -0.1, 0.3, 0.4])
    c = collected(x, y)
    found = squared_residual(c.light(), c.squares, jnp.float32(model)[:, None, None])
    literal = np.mean((y @ WEIGHTS - np.column_stack([np.ones(64), x]) @ model) ** 2)
    np.testing.assert_allclose(found[0, 0], literal, rtol=1e-4)
