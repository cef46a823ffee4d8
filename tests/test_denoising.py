"""`denoise` on frames: the contract others call."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr import denoising, stages
from jflnr.images.guides import shrink
from jflnr.metrics import measure


def changed(frame, **layers):
    return dataclasses.replace(frame, **layers)


def psnr(frame, indirect):
    return measure(frame, np.asarray(indirect))["psnr"]


@pytest.mark.parametrize("name", ["val/dining-room_0", "test/sponza_1"])
def test_agrees_with_an_independent_implementation_on_real_frames(data, name):
    """baselines.json holds the PSNR of a numpy float64 FLR with these parameters."""
    published = json.loads((data / "baselines.json").read_bytes())["frames"][f"{name}.exr"]
    frame = jflnr.read_frame(data / f"{name}.exr")
    for sigma in (10, 24):
        ours = jflnr.denoise(frame, jflnr.FLR(sigma, 1e-3, 1e-4))
        truth = published["1 spp"][f"flr sigma {sigma}"]["psnr"]
        assert psnr(frame, ours) == pytest.approx(truth, abs=0.02)


def test_the_shipped_frame_gains_ten_decibels():
    frame = jflnr.read_frame(denoising.SHIPPED_FRAME)
    assert psnr(frame, jflnr.denoise(frame)) > psnr(frame, frame.indirect) + 10


def test_result_is_float32_of_the_frames_size(frame):
    out = jflnr.denoise(frame)
    assert out.shape == frame.indirect.shape and out.dtype == np.float32


@pytest.mark.parametrize("method", ["flr", "auto"])
def test_without_guides_it_is_a_blur(frame, method):
    image = np.asarray(jflnr.denoise(frame, method, guides=()))
    assert np.isfinite(image).all() and np.std(image) < 0.5 * np.std(frame.indirect)


def test_light_groups_add_up_and_come_out_in_order(frame):
    half = frame.indirect * np.float32(0.25)
    groups = np.concatenate([frame.indirect - half, half], axis=-1)
    out = np.asarray(jflnr.denoise(changed(frame, indirect=groups)))
    whole = np.asarray(jflnr.denoise(frame))
    np.testing.assert_allclose(out[..., :3] + out[..., 3:], whole, atol=1e-4)
    np.testing.assert_allclose(out[..., 3:], 0.25 * whole, atol=1e-4)


def test_twice_the_light_is_twice_the_result(frame):
    twice = jflnr.denoise(changed(frame, indirect=2 * frame.indirect))
    np.testing.assert_allclose(twice, 2 * np.asarray(jflnr.denoise(frame)), rtol=1e-5)


def test_the_unit_of_length_does_not_matter(frame):
    metres = jflnr.denoise(frame, guides=("normal", "depth", "position"))
    scaled = changed(frame, depth=100 * frame.depth, position=100 * frame.position)
    centimetres = jflnr.denoise(scaled, guides=("normal", "depth", "position"))
    np.testing.assert_allclose(metres, centimetres, rtol=1e-3, atol=1e-4)


def test_what_is_outside_the_mask_has_no_influence(frame):
    mask = frame.mask.copy()
    mask[:, :10] = 0
    noise = frame.indirect.copy()
    noise[:, :10] = 1e4
    clean = jflnr.denoise(changed(frame, mask=mask))
    spoiled = jflnr.denoise(changed(frame, mask=mask, indirect=noise))
    np.testing.assert_array_equal(clean, spoiled)


@pytest.mark.parametrize("factor", [2, 4])
def test_smaller_light_that_is_constant_stays_so(frame, backend, factor):
    light = np.full((24 // factor, 40 // factor, 3), 1.5, np.float32)
    out = jflnr.denoise(changed(frame, indirect=light), backend=backend)
    assert out.shape == (24, 40, 3)
    np.testing.assert_allclose(out, 1.5, rtol=1e-5)


@pytest.mark.parametrize("method", ["flr", "flr-adaptive", "auto"])
@pytest.mark.parametrize("factor", [2, 3])
def test_smaller_light_is_upsampled_to_the_guides(frame, backend, method, factor):
    """What follows the guides comes back at their size, but for what regularisation takes."""
    normal = frame.normal + np.sin(np.arange(40) / 5, dtype=np.float32)[:, None] * [1, 0, 0]
    light = (3 + normal[..., :1] * [1, 0.5, 0.25]).astype(np.float32)
    frame = changed(frame, normal=normal.astype(np.float32), indirect=shrink(light, factor))
    out = jflnr.denoise(frame, method, guides=("normal",), backend=backend)
    assert out.shape == (24, 40, 3)
    np.testing.assert_allclose(out, light, rtol=0.02)


def test_without_ao_the_user_is_told(frame):
    with pytest.warns(UserWarning, match="no ao layer"):
        out = jflnr.denoise(changed(frame, ao=None))
    np.testing.assert_array_equal(out, jflnr.denoise(frame, guides=("normal", "depth")))


def test_the_second_frame_does_not_recompile(frame):
    jflnr.denoise(frame)
    before = stages.on_frame.compiled()._cache_size()
    jflnr.denoise(changed(frame, indirect=3 * frame.indirect, reference=None))
    assert stages.on_frame.compiled()._cache_size() == before


def test_gradients_reach_the_parameters(frame):
    def loss(method):
        return (jflnr.denoise(jax.tree.map(jnp.asarray, frame), method) ** 2).sum()

    grads = jax.grad(loss)(jax.tree.map(np.float32, jflnr.FLR(8, 1e-3, 1e-3)))
    assert all(np.isfinite(g) and g != 0 for g in jax.tree.leaves(grads))


@pytest.mark.parametrize(
    ("layers", "options", "words"),
    [
        ({}, {"method": "magic"}, "method must be one of .*magic"),
        ({}, {"backend": "abacus"}, "backend must be one of .*abacus"),
        ({}, {"guides": ("normal", "hue")}, "'hue' is none of"),
        ({}, {"guides": ("normal", "normal")}, "twice"),
        ({"position": None}, {"guides": ("position",)}, "no position layer; it has normal"),
        ({}, {"block": 0}, "block"),
        ({"indirect": np.full((24, 40, 3), np.nan, np.float32)}, {}, "no finite value"),
        ({"indirect": np.zeros((23, 40, 3), np.float32)}, {}, "indirect"),
        ({"ao": np.zeros((24, 41, 1), np.float32)}, {}, "ao"),
    ],
)
def test_wrong_input_is_named(frame, layers, options, words):
    with pytest.raises(ValueError, match=words):
        jflnr.denoise(changed(frame, **layers), **options)


def test_the_adaptive_method_is_better_on_the_shipped_frame():
    frame = jflnr.read_frame(denoising.SHIPPED_FRAME)
    plain, adaptive = (psnr(frame, jflnr.denoise(frame, m)) for m in ("flr", "flr-adaptive"))
    assert adaptive > plain + 0.5


def test_options_of_another_method_are_refused(frame):
    with pytest.raises(TypeError, match="flr-adaptive has no support; it has sigma, eps"):
        jflnr.denoise(frame, "flr-adaptive", support=16)
    with pytest.raises(TypeError, match="flr has no levels"):
        jflnr.denoise(frame, jflnr.FLR(8, 1e-3, 1e-3), levels=2)


def test_a_slit_into_the_open_is_no_bright_streak(rng):
    """Black pixels far behind a wall that brightens with its depth."""
    y, x = np.mgrid[:64, :96].astype(np.float32)[..., None]
    depth, slit = 1 + x / 96 + y / 64, (x >= 47) & (x < 49) & (y > 20) & (y < 44)
    light = (depth - 0.8) * np.ones(3, np.float32)
    frame = jflnr.Frame(
        indirect=np.where(slit, 0, light * rng.exponential(size=light.shape)).astype(np.float32),
        albedo=np.ones((64, 96, 3), np.float32),
        normal=np.tile(np.float32([0, 0, 1]), (64, 96, 1)),
        depth=np.where(slit, 60, depth),
        ao=np.ones_like(depth),
    )
    out = np.asarray(jflnr.denoise(frame, "flr-adaptive"))
    assert out[slit[..., 0]].max() < light.max()
