"""What must hold of FLNR on any image, whatever its weights."""

import jax
import numpy as np
import pytest

from jflnr.network import flnr as networks
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from tests.network.conftest import WIDTHS, scene_of

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@jax.jit
def flnr(target, guides, params, weight):
    return networks.flnr(target, guides, params=params, weight=weight, with_error=True)


@pytest.fixture(scope="module")
def everywhere(scene):
    return np.ones(scene.target.shape[:2], np.float32)


@pytest.fixture(scope="module")
def denoised(scene, params, everywhere):
    return np.asarray(flnr(*scene, params, everywhere)[0])


def test_untrained_it_is_adaptive_flr(scene, everywhere):
    start = networks.init(jax.random.key(0), WIDTHS)
    ours = flnr(*scene, start, everywhere)
    method = AdaptiveFLR(with_error=True)
    wanted = jax.jit(flr_adaptive)(*scene, method, weight=everywhere)
    for mine, theirs in zip(ours, wanted, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=1e-5)


def test_weights_change_the_result_but_not_its_energy(scene, params, denoised, everywhere):
    start = networks.init(jax.random.key(0), WIDTHS)
    assert np.abs(denoised - flnr(*scene, start, everywhere)[0]).max() > 0.05
    before, after = (np.sum(image @ LUMINANCE) for image in (scene.target, denoised))
    assert abs(after / before - 1) < AdaptiveFLR.slack + 1e-4


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_scales_with_the_light(scene, params, denoised, everywhere, scale):
    scaled = flnr(scale * scene.target, scene.guides, params, everywhere)[0]
    np.testing.assert_allclose(scaled / scale, denoised, rtol=1e-3, atol=1e-3)


def test_pixels_that_do_not_count_change_nothing(scene, params, everywhere):
    weight = everywhere.copy()
    weight[10:20, 10:30] = 0
    spoiled = scene.target.copy()
    spoiled[10:20, 10:30] = 1e6
    spoiled[12, 12] = np.nan
    plain, other = (flnr(t, scene.guides, params, weight)[0] for t in (scene.target, spoiled))
    np.testing.assert_allclose(other, plain, rtol=1e-4, atol=1e-5)


def test_light_groups_sum_to_the_whole(scene, params, denoised, everywhere):
    share = np.linspace(0, 1, scene.target.shape[1])[None, :, None]
    groups = np.concatenate([share * scene.target, (1 - share) * scene.target], axis=-1)
    found = np.asarray(flnr(np.float32(groups), scene.guides, params, everywhere)[0])
    np.testing.assert_allclose(found[..., :3] + found[..., 3:], denoised, rtol=1e-3, atol=1e-3)


def test_a_frame_without_occlusion(params):
    target, guides = scene_of(3, 9)
    out, _ = flnr(target, guides[..., :4], params, np.ones((3, 9), np.float32))
    assert out.shape == (3, 9, 3)
    assert np.isfinite(out).all()


def test_darkness_stays_dark(scene, params, everywhere):
    assert not np.any(flnr(0 * scene.target, scene.guides, params, everywhere)[0])
