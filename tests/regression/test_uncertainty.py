"""What must hold of the error that adaptive FLR tells of itself."""

import dataclasses

import numpy as np
import pytest

import jflnr
from jflnr.denoising import SHIPPED_FRAME

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def shipped():
    frame = jflnr.read_frame(SHIPPED_FRAME)
    return frame, *map(np.asarray, jflnr.denoise_with_error(frame))


def test_the_image_is_the_one_without(shipped):
    frame, image, error = shipped
    assert error.shape == (*image.shape[:2], 1)
    np.testing.assert_allclose(image, jflnr.denoise(frame, "flr-adaptive"), rtol=1e-4, atol=1e-6)


def test_nine_pixels_of_ten_are_in_the_interval(shipped):
    frame, image, error = shipped
    off = np.abs((image - frame.reference) @ LUMINANCE)
    inside = np.asarray(frame.mask)[..., 0] > 0
    assert 0.85 < np.mean((off <= 1.645 * error[..., 0])[inside]) < 0.98


def test_scales_with_the_light(shipped):
    frame, _, error = shipped
    brighter = dataclasses.replace(frame, indirect=1000 * np.asarray(frame.indirect))
    np.testing.assert_allclose(jflnr.denoise_with_error(brighter)[1] / 1000, error, rtol=1e-2)


def test_a_black_frame_has_a_finite_error(shipped):
    frame, _, _ = shipped
    black = dataclasses.replace(frame, indirect=0 * np.asarray(frame.indirect))
    image, error = jflnr.denoise_with_error(black)
    assert np.isfinite(error).all() and not np.any(image)
