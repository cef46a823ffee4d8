"""What must hold of `jflnr.select` and of method auto on any frame."""

import dataclasses

import numpy as np
import pytest

import jflnr
from jflnr.auto import plan as plans
from jflnr.auto.collected import hold
from jflnr.auto.complexity import is_simple
from jflnr.auto.method import denoise_on_blocks
from jflnr.auto.plan import choose


def test_scales_with_the_light(frame):
    once = jflnr.denoise(frame, "auto")
    more = dataclasses.replace(frame, indirect=1000 * frame.indirect)
    np.testing.assert_allclose(jflnr.denoise(more, "auto") / 1000, once, rtol=1e-3)


@pytest.mark.parametrize("form", plans.BLOCKS)
def test_constant_light_stays_constant_to_the_edge(frame, form):
    flat = dataclasses.replace(frame, indirect=np.full_like(frame.indirect, 0.7))
    np.testing.assert_allclose(denoise_on_blocks(flat, form)[0], 0.7, rtol=1e-4)


def test_pixels_outside_the_mask_do_not_count(frame):
    mask = np.ones_like(frame.mask)
    mask[:, :12] = 0
    spoilt = frame.indirect.copy()
    spoilt[:, :12] = 1e4
    spoilt[3, 5] = np.nan
    one, other = (
        denoise_on_blocks(dataclasses.replace(frame, mask=mask, indirect=light), "blocks-4")[0]
        for light in (frame.indirect, spoilt)
    )
    np.testing.assert_allclose(one[:, 12:], other[:, 12:], rtol=1e-4)


def test_energy_is_kept_if_asked_for(frame):
    image = np.asarray(jflnr.denoise(frame, "auto", keep_energy=True))
    weights = np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose((image @ weights).sum(), (frame.indirect @ weights).sum(), rtol=1e-4)


def test_blends_without_seams(rng):
    """Where the order of the models changes, the image does not jump at the blocks' borders."""
    height, width = 64, 1024
    y, x = np.mgrid[:height, :width].astype(np.float32)[..., None] / 32
    # No window of the left part reaches the ambient occlusion, which lights the right part.
    ao = np.clip(x - 24, 0, 1) * (0.5 + 0.5 * np.sin(6 * y))
    noise = rng.gamma(4, 1 / 4, size=(height, width, 1))
    light = np.broadcast_to((0.5 + ao) * noise, (height, width, 3)).astype(np.float32)
    flat = np.broadcast_to(np.float32([0, 0, 1]), (height, width, 3))
    smooth = jflnr.Frame(indirect=light, albedo=flat, normal=flat, depth=1 + 0 * x, ao=ao)
    image, models = denoise_on_blocks(smooth, "blocks-8")
    assert np.ptp(models.order) > 0.9
    side = height // models.order.shape[0]
    steps = np.abs(np.diff(np.asarray(image)[..., 0], axis=1))
    at_borders = steps[:, side - 1 :: side].mean()
    assert at_borders < 1.1 * steps[:, side // 2 - 1 :: side].mean()


def test_plan_tells_what_was_done(frame):
    plan, image = jflnr.select(frame, target_db=1.0)
    assert plan.form == "blocks-16"
    assert plan.milliseconds > 0
    assert image.shape == frame.indirect.shape
    assert set(plan.guides) <= {"normal", "depth", "ao"}
    assert plan.form in plan.lines()[0]


def test_small_frames(rng):
    image = rng.random((1, 9, 3), np.float32)
    one = jflnr.Frame(indirect=image, albedo=image, normal=image, depth=image[..., :1])
    out = jflnr.denoise(one, "auto", guides=("normal", "depth"))
    assert out.shape == image.shape
    assert np.isfinite(out).all()


def test_refusals(frame):
    with pytest.raises(ValueError, match="jax backend"):
        jflnr.denoise(frame, "auto", backend="opencl")
    with pytest.raises(ValueError, match="does not work in tiles"):
        jflnr.denoise(frame, "auto", tile=256)
    with pytest.raises(ValueError, match="budget_ms is -1"):
        jflnr.select(frame, budget_ms=-1)
    half = dataclasses.replace(frame, indirect=frame.indirect[::2, ::2])
    with pytest.raises(ValueError, match="size of the guides"):
        jflnr.denoise(half, "auto")


def test_choice():
    forms = plans.FORMS
    decibels = dict(zip(forms, (20.0, 21.0, 21.5, 21.6), strict=True))
    ms = dict(zip(forms, (10.0, 14.0, 40.0, 45.0), strict=True))
    for budget_ms, target_db, wanted in (
        (None, 20.5, "blocks-8"),
        (None, 30.0, "flnr"),
        (42.0, None, "blocks-4"),
        (15.0, 30.0, "blocks-8"),
        (1.0, None, "blocks-16"),
    ):
        limits = plans.Limits(budget_ms, target_db)
        assert choose("blocks-16", decibels, plans.COSTS, ms, limits) == wanted
    for more, wanted in ((21.01, "blocks-8"), (30.0, "blocks-4")):
        decibels = {"blocks-8": 21.0, "blocks-4": more, "flnr": 40.0}
        assert choose("blocks-8", decibels, plans.COSTS, None, plans.Limits()) == wanted
    assert choose("blocks-16", dict.fromkeys(forms, 21.0), plans.COSTS, None, plans.Limits()) == (
        "blocks-16"
    )


def test_a_tight_budget_begins_with_the_smallest_form():
    limits = plans.Limits(budget_ms=10.0, seconds=1e-8)
    assert plans.first(False, limits, 10_000_000) == "blocks-16"
    assert plans.first(False, limits, 100_000) == "blocks-8"


def test_a_simple_frame_gets_more_only_if_more_is_asked_for():
    assert plans.first(True, plans.Limits(), 100) == "blocks-16"
    assert plans.first(True, plans.Limits(budget_ms=1e3, seconds=1e-8), 100) == "blocks-8"


def test_a_wall_is_simple_and_a_hedge_is_not(frame, rng):
    assert is_simple(frame)
    leaves = rng.standard_normal(frame.normal.shape).astype(np.float32)
    assert not is_simple(dataclasses.replace(frame, normal=leaves))
    steps = 1 + 3 * (rng.random(frame.depth.shape) > 0.5).astype(np.float32)
    assert not is_simple(dataclasses.replace(frame, depth=steps))


def test_a_guide_held_at_its_mean_changes_nothing_at_the_mean(rng):
    means = np.float32([1, 0.5, 3])[:, None, None]
    models = rng.random((3, 1, 1, 1)).astype(np.float32)
    held = np.ravel(hold(models, means, [0]))
    value, first, second = np.ravel(models)
    np.testing.assert_allclose(held, [value + 3 * second, first], rtol=1e-6)


def test_guides_that_do_nothing_are_not_read(frame):
    """Light that follows the ambient occlusion: the normal, which is constant, is left out."""
    light = np.broadcast_to(0.2 + np.sin(20 * frame.ao), frame.indirect.shape)
    models = denoise_on_blocks(dataclasses.replace(frame, indirect=np.float32(light)), "blocks-8")[
        1
    ]
    assert "normal" not in plans.worth_reading(models, ("normal", "depth", "ao"))
