"""Dividing by albedo: exact where it can be, harmless where it cannot."""

import numpy as np
import pytest

from jflnr.layouts.light import DARK, demodulate, rest


def image(*pixels: tuple[float, float, float]) -> np.ndarray:
    return np.array([pixels], np.float32)


def test_light_times_albedo_is_radiance(rng: np.random.Generator) -> None:
    albedo = rng.uniform(2 * DARK, 1.5, (5, 6, 3)).astype(np.float32)
    radiance = rng.exponential(size=(5, 6, 3)).astype(np.float32)
    np.testing.assert_allclose(albedo * demodulate(radiance, albedo), radiance, rtol=1e-6)


def test_a_dark_channel_takes_the_light_of_the_others() -> None:
    """A red wall under white light 2 must not look, to its neighbours, as if lit in red."""
    albedo = image((0.8, 0.004, 0.0), (0.005, 0.005, 0.005))
    light = demodulate(2 * albedo, albedo)
    np.testing.assert_allclose(light, image((2, 2, 2), (0, 0, 0)), rtol=1e-6)


@pytest.mark.parametrize("value", [0, 1e-30, DARK, 0.5])
def test_the_rest_makes_up_for_it_exactly(value: float) -> None:
    albedo, picture = image((value, 0.5, 0.7)), image((3, 0.2, 1e-3))
    light = demodulate(picture, albedo)
    np.testing.assert_allclose(albedo * light + rest(picture, albedo, light), picture, rtol=1e-6)


@pytest.mark.parametrize("albedo", [np.nan, np.inf, -1.0, 1e-38])
def test_strange_albedo_warns_of_nothing(albedo: float) -> None:
    picture = image((np.inf, 1, 3e38), (np.nan, -np.inf, 0))
    light = demodulate(picture, np.full_like(picture, albedo))
    assert rest(picture, np.full_like(picture, albedo), light).shape == picture.shape


def test_pixels_that_are_not_finite() -> None:
    albedo = image((0.5, 0.5, 0.5), (0, 0, 0))
    picture = image((np.nan, np.inf, 1), (np.inf, 1, 2))
    light = demodulate(picture, albedo)
    assert not np.isfinite(light[0, 0, :2]).any()
    assert (rest(picture, albedo, light)[0, 0] == 0).all()
    np.testing.assert_array_equal(rest(picture, albedo, light)[0, 1], picture[0, 1])
