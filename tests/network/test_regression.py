"""What must hold of FLNR on any image, whatever its weights."""

import jax
import numpy as np
import pytest

from jflnr.network import flnr as regression
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from tests.flnr.conftest import WIDTHS, scene_of

flnr = jax.jit(
    lambda target, guides, params, weight: regression.flnr(target, guides, params, weight=weight)
)


@pytest.fixture(scope="module")
def everywhere(scene):
    return np.ones(scene.target.shape[:2], np.float32)


@pytest.fixture(scope="module")
def denoised(scene, params, everywhere):
    return np.asarray(flnr(*scene, params, everywhere))


def test_untrained_it_is_adaptive_flr(scene, everywhere):
    start = regression.init(jax.random.key(0), WIDTHS)
    ours = flnr(*scene, start, everywhere)
    wanted = jax.jit(flr_adaptive)(*scene, AdaptiveFLR(), weight=everywhere)
    np.testing.assert_allclose(ours, wanted, atol=1e-5)


def test_weights_change_the_result(scene, params, denoised, everywhere):
    start = regression.init(jax.random.key(0), WIDTHS)
    assert np.abs(denoised - flnr(*scene, start, everywhere)).max() > 0.05


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_scales_with_the_light(scene, params, denoised, everywhere, scale):
    scaled = flnr(scale * scene.target, scene.guides, params, everywhere)
    np.testing.assert_allclose(scaled / scale, denoised, rtol=1e-3, atol=1e-3)


def test_pixels_that_do_not_count_change_nothing(scene, params, everywhere):
    weight = everywhere.copy()
    weight[10:20, 10:30] = 0
    spoiled = scene.target.copy()
    spoiled[10:20, 10:30] = 1e6
    spoiled[12, 12] = np.nan
    plain, other = (flnr(t, scene.guides, params, weight) for t in (scene.target, spoiled))
    np.testing.assert_allclose(other, plain, rtol=1e-4, atol=1e-5)


def test_a_frame_smaller_than_the_coarsest_blocks(params):
    target, guides = scene_of(3, 9)
    out = flnr(target, guides, params, np.ones((3, 9), np.float32))
    assert out.shape == (3, 9, 3)
    assert np.isfinite(out).all()


def test_darkness_stays_dark(scene, params, everywhere):
    np.testing.assert_allclose(flnr(0 * scene.target, scene.guides, params, everywhere), 0, atol=1)
