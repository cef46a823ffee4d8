"""Method auto: what must hold of it on any frame, and where it refines."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr.frame import Frame
from jflnr.regression.auto import Auto, light_moments, signal_in_tiles, squared_residual
from jflnr.regression.level import brightness
from jflnr.regression.moments import collect

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
# Of the textured frame: pixels, and the column from which its light has detail that no guide shows.
SIZE, DETAIL = (96, 448), 256


@pytest.fixture(scope="module")
def textured() -> Frame:
    """Smooth light on the left, stripes of 60 pixels on the right, both with little noise."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)[..., None]
    stripes = 1 + 0.9 * np.sin(2 * np.pi * (x + y) / 60) * (x >= DETAIL)
    noise = np.random.default_rng(0).gamma(4, 1 / 4, (*SIZE, 1))
    light = np.repeat(stripes * noise, 3, axis=-1).astype(np.float32)
    flat = np.broadcast_to(np.float32([0, 0, 1]), light.shape)
    return Frame(indirect=light, normal=flat, depth=1 + x / 448, ao=0.5 + 0 * x)


def with_worth(frame: Frame, worth: float) -> np.ndarray:
    return np.asarray(jflnr.denoise(frame, Auto(worth=worth)))


def test_refines_where_there_is_detail_and_not_elsewhere(textured: Frame) -> None:
    signal, side = signal_in_tiles(textured)
    assert side == 32 and signal.shape == (3, 14)
    refined = signal > Auto().worth
    assert refined[:, DETAIL // side + 1 :].all()
    assert not refined[:, : DETAIL // side - 2].any()


def test_nothing_changes_outside_the_refined_tiles(textured: Frame) -> None:
    found, coarse = with_worth(textured, 0.6), with_worth(textured, 1.0)
    whole = with_worth(textured, 1e-9)
    # The factor that gives back brightness is one for the frame, and pixels look to the next block.
    np.testing.assert_allclose(found[:, :160], coarse[:, :160], rtol=0.01)
    np.testing.assert_allclose(found[:, 320:], whole[:, 320:], rtol=0.01)
    assert np.abs(whole - coarse)[:, 320:].mean() > 0.1


def test_no_seams_at_the_tiles(textured: Frame) -> None:
    """Steps between neighbours across borders of tiles are like those across borders of blocks."""
    image = with_worth(textured, 0.6)[..., 0]
    signal, side = signal_in_tiles(textured)
    ends = np.flatnonzero(np.any(np.diff(signal > 0.6, axis=1), axis=0)) * side + side - 1
    assert len(ends)
    steps = np.abs(np.diff(image, axis=1)).mean(axis=0)
    inside = steps[DETAIL + side : -side].max()
    assert all(steps[end] < inside for end in ends)


def test_scales_with_the_light(frame: Frame) -> None:
    more = dataclasses.replace(frame, indirect=1000 * frame.indirect)
    found = jflnr.denoise(more, "auto")
    np.testing.assert_allclose(found / 1000, jflnr.denoise(frame, "auto"), rtol=1e-3)


def test_constant_light_stays_constant_to_the_edge(frame: Frame) -> None:
    flat = dataclasses.replace(frame, indirect=np.full_like(frame.indirect, 0.7))
    np.testing.assert_allclose(jflnr.denoise(flat, "auto"), 0.7, rtol=1e-4)


def test_pixels_outside_the_mask_do_not_count(frame: Frame) -> None:
    mask = np.ones_like(frame.mask)
    mask[:, :12] = 0
    spoilt = frame.indirect.copy()
    spoilt[:, :12] = 1e4
    spoilt[3, 5] = np.nan
    one, other = (
        jflnr.denoise(dataclasses.replace(frame, mask=mask, indirect=light), "auto")
        for light in (frame.indirect, spoilt)
    )
    np.testing.assert_allclose(one[:, 12:], other[:, 12:], rtol=1e-4)


def test_residual_from_moments_is_that_of_the_pixels(rng: np.random.Generator) -> None:
    x = rng.standard_normal((64, 4))
    y = 2 + x @ rng.standard_normal((4, 3)) * 0.3 + 0.5 * rng.standard_normal((64, 3))
    model = np.array([1.5, 0.2, -0.1, 0.3, 0.4])
    images = (jnp.float32(image.reshape(8, 8, -1)) for image in (y, x))
    planes = collect(*images, jnp.zeros(4), 8, None, brightness(3, jnp.float32))
    found = squared_residual(
        light_moments(planes, 4), planes[-2], jnp.float32(model)[:, None, None]
    )
    literal = np.mean((y @ WEIGHTS - np.column_stack([np.ones(64), x]) @ model) ** 2)
    np.testing.assert_allclose(found[0, 0], literal, rtol=1e-4)
