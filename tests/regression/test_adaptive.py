"""What must hold of adaptive FLR on any image."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.images.noisy_guides import smooth_guide
from jflnr.network.flnr import flnr
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.adaptive import flr_adaptive as uncompiled
from jflnr.regression.flr import FLR, flr

flr_adaptive = jax.jit(uncompiled, static_argnames=("block", "levels", "keep_energy"))
EXACT_ENERGY = AdaptiveFLR(slack=1e-6)


def guides(rng, height, width, count=2):
    y, x = np.mgrid[:height, :width] / 10
    waves = [np.sin((k + 1) * y * 0.7) * np.cos(x * (k + 2) * 0.4) for k in range(count)]
    return jnp.asarray(np.stack(waves, -1) + 0.05 * rng.standard_normal((height, width, count)))


def light(rng, height, width, channels=3):
    y, x = np.mgrid[:height, :width, :1][:2]
    mean = 1 + np.sin(x / 9) * np.cos(y / 7) * 0.8
    return jnp.asarray(mean * rng.exponential(size=(height, width, channels)))


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(3)
    return jnp.float32(guides(rng, 37, 50)), jnp.float32(light(rng, 37, 50))


@pytest.fixture(scope="module")
def denoised(scene):
    x, y = scene
    return flr_adaptive(y, x, AdaptiveFLR(), levels=2)


@pytest.mark.parametrize("moved", [False, True])
def test_without_adapting_it_is_flr(scene, moved):
    """Also evaluated on other guides than those of the fit."""
    x, y = scene
    mapped = {"guides_map": x[::-1]} if moved else {}
    off = AdaptiveFLR(
        sigma=2.0,
        noise_ridge=1e-30,
        position_ridge=1e30,
        exponent=1e-30,
        guide_scale=1e-20,
        slack=1e9,
    )
    ours = flr_adaptive(y, x, off, block=16, levels=1, **mapped)
    plain = flr(y, x, FLR(16.0, 1e-4, 1e-4), block=8, support=40, **mapped)
    np.testing.assert_allclose(ours, plain, atol=1e-4)


def test_scales_with_the_light(scene, denoised):
    x, y = scene
    scaled = flr_adaptive(1000 * y, x, AdaptiveFLR(), levels=2)
    np.testing.assert_allclose(scaled / 1000, denoised, rtol=1e-3, atol=1e-4)


def test_light_groups_add_up(scene):
    x, y = scene
    share = jnp.float32(np.random.default_rng(5).random(y.shape))
    groups = jnp.concatenate([y * share, y * (1 - share)], axis=-1)
    apart = flr_adaptive(groups, x, AdaptiveFLR(), levels=2)
    together = flr_adaptive(y, x, AdaptiveFLR(), levels=2)
    np.testing.assert_allclose(apart[..., :3] + apart[..., 3:], together, atol=1e-4)


def test_less_noise_than_the_input_and_about_its_energy(scene, denoised):
    _, y = scene
    assert np.std(denoised) < np.std(y) / 2
    assert abs(np.mean(denoised) / np.mean(y) - 1) < 0.04


def test_energy_is_kept_exactly_on_demand(scene):
    x, y = scene
    weights = np.array([0.2126, 0.7152, 0.0722])
    kept = flr_adaptive(y, x, AdaptiveFLR(), levels=2, keep_energy=True)
    np.testing.assert_allclose(np.sum(kept @ weights), np.sum(y @ weights), rtol=1e-4)


def test_a_constant_stays_constant(scene):
    x, y = scene
    out = flr_adaptive(jnp.full_like(y, 2.5), x, EXACT_ENERGY, levels=2)
    np.testing.assert_allclose(out, 2.5, rtol=1e-4)


def test_black_stays_black(scene):
    x, y = scene
    out = flr_adaptive(jnp.zeros_like(y), x, AdaptiveFLR(), levels=2)
    np.testing.assert_array_equal(out, 0)


def test_what_is_not_finite_is_as_good_as_masked(scene):
    x, y = scene
    bad = np.random.default_rng(7).random(y.shape[:2]) < 0.1
    spoiled = jnp.where(bad[..., None], jnp.nan, y)
    out = flr_adaptive(spoiled, x, AdaptiveFLR(), levels=2)
    masked = flr_adaptive(y, x, AdaptiveFLR(), levels=2, weight=jnp.float32(~bad))
    assert np.isfinite(out).all()
    np.testing.assert_allclose(out, masked, atol=1e-5)
    assert np.isfinite(flr_adaptive(y * jnp.nan, x, AdaptiveFLR(), levels=2)).all()


@pytest.mark.slow  # compiles long
@pytest.mark.parametrize("size", [(1, 1), (3, 70)])
def test_small_and_odd_sizes(rng, size):
    x, y = jnp.float32(guides(rng, *size, 1)), jnp.float32(light(rng, *size))
    out = flr_adaptive(y, x, AdaptiveFLR(), levels=2)
    assert out.shape == y.shape
    assert np.isfinite(out).all()


@pytest.mark.slow  # compiles long
def test_no_guides_at_all(scene):
    _, y = scene
    out = flr_adaptive(y, jnp.zeros((*y.shape[:2], 0)), AdaptiveFLR(), levels=2)
    assert np.isfinite(out).all()


@pytest.mark.slow  # compiles long
def test_gradients_are_finite_and_of_use(scene):
    x, y = scene

    def loss(parameters, y, x):
        return jnp.mean(uncompiled(y, x, parameters, levels=2) ** 2)

    gradients = jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(AdaptiveFLR(), y, x)
    leaves = jax.tree.leaves(gradients)
    assert all(np.isfinite(leaf).all() for leaf in leaves)
    assert sum(float(jnp.abs(leaf).max()) > 0 for leaf in leaves) >= 10


def test_other_parameters_do_not_compile_again(scene):
    x, y = scene
    flr_adaptive(y, x, AdaptiveFLR(), levels=2)
    before = flr_adaptive._cache_size()
    flr_adaptive(y, x, AdaptiveFLR(sigma=1.5, caution=2.0), levels=2)
    assert flr_adaptive._cache_size() == before


def test_light_far_below_the_brightest_pixel_stays_a_number(scene):
    """Where that one does not count, what it is divided by leaves squares beyond float32."""
    x, y = scene
    light, weight = jnp.full((*y.shape[:2], 1), 1e-20).at[3, 4].set(1e8), jnp.ones(y.shape[:2])
    found = flr_adaptive(light, x, AdaptiveFLR(), levels=2, weight=weight.at[3, 4].set(0))
    assert jnp.isfinite(found).all()


def test_wrong_arguments_are_named(scene):
    x, y = scene
    with pytest.raises(ValueError, match="levels"):
        uncompiled(y, x, AdaptiveFLR(), levels=0)
    with pytest.raises(ValueError, match="guides"):
        uncompiled(y, x[:4], AdaptiveFLR())
    with pytest.raises(ValueError, match="guides_map must be a whole number of times larger"):
        uncompiled(y, x, AdaptiveFLR(), guides_map=jnp.concatenate([x, x]))
    twice = 2 * y.shape[0], 2 * y.shape[1], 5
    with pytest.raises(ValueError, match="method flnr needs guides_map at the size of target"):
        flnr(jnp.tile(y[..., :1], 3), jnp.ones((*y.shape[:2], 5)), guides_map=jnp.ones(twice))
    with pytest.raises(ValueError, match="caution"):
        AdaptiveFLR(caution=-1)


def test_smoothing_a_guide_stops_at_edges(rng):
    normal = np.zeros((20, 30, 3), np.float32)
    normal[:, :15, 0], normal[:, 15:, 1] = 1, 1
    truth = np.where(np.arange(30) < 15, 0.2, 0.8)[None, :, None] * np.ones((20, 1, 1))
    noisy = np.float32(truth + 0.05 * rng.standard_normal(truth.shape))
    smooth = smooth_guide(jnp.asarray(noisy), jnp.asarray(normal), jnp.ones((20, 30, 1)))
    assert np.std(smooth - truth) < 0.5 * np.std(noisy - truth)
    noisy[4, 5] = np.nan
    bad = ~np.isfinite(smooth_guide(jnp.asarray(noisy), jnp.asarray(normal), jnp.ones((20, 30, 1))))
    assert bad.sum() == 1
