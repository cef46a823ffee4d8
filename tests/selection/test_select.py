"""What must hold of `jflnr.select` and of method auto on any frame."""

import dataclasses

import numpy as np
import pytest

import jflnr
from jflnr.selection import plan as plans
from jflnr.selection.blocks import Collected, hold
from jflnr.selection.method import denoise_on_blocks
from jflnr.selection.plan import choose


def test_scales_with_the_light(frame):
    once = jflnr.denoise(frame, "auto")
    more = dataclasses.replace(frame, indirect=1000 * frame.indirect)
    np.testing.assert_allclose(jflnr.denoise(more, "auto") / 1000, once, rtol=1e-3)


def test_constant_light_stays_constant_to_the_edge(frame):
    flat = dataclasses.replace(frame, indirect=np.full_like(frame.indirect, 0.7))
    np.testing.assert_allclose(denoise_on_blocks(flat)[0], 0.7, rtol=1e-4)


def test_pixels_outside_the_mask_do_not_count(frame):
    mask = np.ones_like(frame.mask)
    mask[:, :12] = 0
    spoilt = frame.indirect.copy()
    spoilt[:, :12] = 1e4
    spoilt[3, 5] = np.nan
    one, other = (
        denoise_on_blocks(dataclasses.replace(frame, mask=mask, indirect=light))[0]
        for light in (frame.indirect, spoilt)
    )
    np.testing.assert_allclose(one[:, 12:], other[:, 12:], rtol=1e-4)


def test_energy_is_kept_if_asked_for(frame):
    image = np.asarray(jflnr.denoise(frame, "auto", keep_energy=True))
    weights = np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose((image @ weights).sum(), (frame.indirect @ weights).sum(), rtol=1e-4)


def test_blends_without_seams(rng):
    """Where the models change, the image does not jump at the blocks' borders."""
    height, width = 64, 96
    y, x = np.mgrid[:height, :width].astype(np.float32)[..., None] / 32
    ao = np.clip(x - 1, 0, 1) * (0.5 + 0.5 * np.sin(9 * y))
    noise = rng.exponential(size=(height, width, 1))
    light = np.broadcast_to((0.5 + ao) * noise, (height, width, 3)).astype(np.float32)
    flat = np.broadcast_to(np.float32([0, 0, 1]), (height, width, 3))
    smooth = jflnr.Frame(indirect=light, albedo=flat, normal=flat, depth=1 + 0 * x, ao=ao)
    image, models = denoise_on_blocks(smooth)
    assert np.ptp(models.coefficients) > 0
    steps = np.abs(np.diff(np.asarray(image)[..., 0], axis=1))
    at_borders = steps[:, 7::8].mean()
    assert at_borders < 1.5 * steps[:, 3::8].mean()


def test_plan_tells_what_was_done(frame):
    plan, image = jflnr.select(frame, target_db=1.0)
    assert plan.form == plans.BLOCKS
    assert plan.milliseconds > 0
    assert image.shape == frame.indirect.shape
    assert set(plan.guides) <= {"normal", "depth", "ao"}
    assert plan.form in plan.lines()[0]


def test_small_frames(rng):
    for height, width in ((1, 1), (7, 9)):
        image = rng.random((height, width, 3), np.float32)
        one = jflnr.Frame(indirect=image, albedo=image, normal=image, depth=image[..., :1])
        out = jflnr.denoise(one, "auto", guides=("normal", "depth"))
        assert out.shape == image.shape
        assert np.isfinite(out).all()


def test_refusals(frame):
    with pytest.raises(ValueError, match="jax backend"):
        jflnr.denoise(frame, "auto", backend="opencl")
    with pytest.raises(ValueError, match="in one piece"):
        jflnr.denoise(frame, "auto", tile=256)
    with pytest.raises(ValueError, match="budget_ms is -1"):
        jflnr.select(frame, budget_ms=-1)
    half = dataclasses.replace(frame, indirect=frame.indirect[::2, ::2])
    with pytest.raises(ValueError, match="size of the guides"):
        jflnr.denoise(half, "auto")


def test_choice():
    decibels = dict(zip(plans.FORMS, (21.0, 21.5, 21.6), strict=True))
    ms = dict(zip(plans.FORMS, (14.0, 40.0, 45.0), strict=True))
    assert choose(decibels, plans.COSTS, ms, None, 20.5) == "blocks"
    assert choose(decibels, plans.COSTS, ms, None, 30.0) == "flnr"
    assert choose(decibels, plans.COSTS, ms, 42.0, None) == "flr-adaptive"
    assert choose(decibels, plans.COSTS, ms, 20.0, 30.0) == "blocks"
    assert choose(decibels, plans.COSTS, ms, 1.0, None) == "blocks"
    assert choose({"blocks": 21.0, "flnr": 30.0}, plans.COSTS, None, None, None) == "flnr"
    assert choose({"blocks": 21.0, "flnr": 21.01}, plans.COSTS, None, None, None) == "blocks"


def test_a_guide_held_at_its_mean_changes_nothing_at_the_mean(rng):
    """Two guides of means 0.5 and 3 about a shift of 0; the second is held."""
    moments = np.zeros((9, 1, 1), np.float32)
    moments[:, 0, 0] = [1, 0.5, 0.3, 3, 1.5, 9.2, 0, 0, 0]
    collected = Collected(moments, moments[0], np.zeros(2), np.ones(()))
    models = rng.random((3, 1, 1, 1)).astype(np.float32)
    held = np.ravel(hold(models, collected, [0]))
    value, first, second = np.ravel(models)
    np.testing.assert_allclose(held, [value + 3 * second, first], rtol=1e-6)


def test_guides_that_do_nothing_are_not_read(frame):
    """Light that follows the ambient occlusion: the normal, which is constant, is left out."""
    light = np.broadcast_to(0.2 + np.sin(20 * frame.ao), frame.indirect.shape)
    models = denoise_on_blocks(dataclasses.replace(frame, indirect=np.float32(light)))[1]
    assert "normal" not in plans.worth_reading(models, ("normal", "depth", "ao"))
