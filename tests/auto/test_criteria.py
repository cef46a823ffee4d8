"""The criteria against their definitions, pixel by pixel."""

import numpy as np
import pytest

from experiments import criteria


@pytest.fixture
def pixels(rng):
    x = np.column_stack([np.ones(40), rng.standard_normal((40, 3))])
    return x, x @ [1.0, 0.5, -0.2, 0.1] + rng.standard_normal(40)


def sums(x, y):
    return criteria.Sums(x.T @ x, x.T @ y, y @ y)


def test_leaving_out_is_a_literal_refit(pixels):
    x, y = pixels
    for left in (slice(7, 8), slice(10, 18)):
        others = np.delete(np.arange(40), left)
        model = np.linalg.lstsq(x[others], y[others], rcond=None)[0]
        literal = np.mean((y[left] - x[left] @ model) ** 2)
        found = criteria.leave_out(sums(x, y), sums(x[left], y[left]), 0.0)
        np.testing.assert_allclose(found, literal, rtol=1e-6)


def test_gcv_is_leaving_one_out_with_the_mean_leverage(pixels):
    x, y = pixels
    hat = x @ np.linalg.solve(x.T @ x, x.T)
    literal = np.mean(((y - hat @ y) / (1 - np.trace(hat) / 40)) ** 2)
    all_of_it = sums(x, y)
    model = criteria.solve(all_of_it, 0.0)
    freedom = criteria.freedom(all_of_it, 0.0)
    found = criteria.gcv(criteria.mean_residual(all_of_it, model), freedom, np.array(40))
    np.testing.assert_allclose(found, literal, rtol=1e-6)


def test_mallows_is_unbiased(rng):
    x = np.column_stack([np.ones(40), rng.standard_normal((40, 3))])
    truth = np.sin(3 * x[:, 1])
    told, true = [], []
    for _ in range(2000):
        y = truth + 0.7 * rng.standard_normal(40)
        model = criteria.solve(sums(x, y), 0.0)
        square = criteria.mean_residual(sums(x, y), model)
        told.append(criteria.mallows(square, np.array(0.49), np.array(4.0), np.array(40)) - 0.49)
        true.append(np.mean((truth - x @ model) ** 2))
    assert abs(np.mean(told) - np.mean(true)) < 4 * np.std(told) / np.sqrt(2000)


def test_a_lower_order_is_a_part_of_the_same_sums(pixels):
    x, y = pixels
    found = criteria.solve(sums(x, y).order(2), 0.0)
    np.testing.assert_allclose(found, np.linalg.lstsq(x[:, :2], y, rcond=None)[0], rtol=1e-6)
