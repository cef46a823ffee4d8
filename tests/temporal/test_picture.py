"""The history of whole pictures, in JAX and on a device: what it keeps, follows, leaves alone."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
import pytest

import jflnr
from jflnr import temporal
from jflnr.opencl import Context, NoDevice
from jflnr.opencl.temporal_picture import follow as follow_on_device
from jflnr.temporal.picture import EXPLAINED, LEAST, Past, follow, moved_to

HEIGHT, WIDTH = 40, 56
STILL = np.zeros((HEIGHT, WIDTH, 2), np.float32)
Follow = Callable[..., Past]


@pytest.fixture(scope="module", params=["jax", "opencl"])
def run(request: pytest.FixtureRequest) -> Follow:
    """`follow` of and to arrays of numpy."""
    if request.param == "jax":
        compiled = jax.jit(follow)
        return lambda *arguments: Past(*map(np.asarray, compiled(*arguments)))
    try:
        context = Context()
    except NoDevice as error:
        pytest.skip(str(error))

    def on_device(past: Past, *arguments: Any) -> Past:
        there = Past(*(context.array(np.asarray(image, np.float32)) for image in past))
        return Past(*(image.get() for image in follow_on_device(context, there, *arguments)))

    return on_device


def nothing(channels: int = 3) -> Past:
    return Past(np.zeros((HEIGHT, WIDTH, channels), np.float32), 0 * STILL[..., :1])


def truth(channels: int = 3) -> np.ndarray:
    """Smooth, from dark to bright."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] / 20
    image = np.stack([np.exp(np.sin(x + c) + np.cos(y - c)) for c in range(channels)], -1)
    return image.astype(np.float32)


def noisy(random: np.random.Generator, spread: float, channels: int = 3) -> tuple[Any, Any]:
    """A denoised picture, and the standard error of its brightness that is told: twice what it is,
    since what the errors barely explain counts as a change."""
    clean = truth(channels)
    # Independent in three channels, the errors of brightness are about 0.75 of those of each.
    error = 2 * 0.75 * spread * clean.mean(-1, keepdims=True)
    picture = clean * np.maximum(1 + spread * random.normal(size=clean.shape), 0)
    return picture.astype(np.float32), error.astype(np.float32)


def off(image: Any, clean: np.ndarray) -> float:
    return float(np.sqrt(np.mean((np.asarray(image) - clean) ** 2)))


def test_what_is_still_comes_closer_to_the_truth(run: Follow) -> None:
    """About as close as a mean of all frames; the first is the frame alone."""
    random, past = np.random.default_rng(0), nothing()
    frames = [noisy(random, 0.1) for _ in range(16)]
    for i, (picture, error) in enumerate(frames):
        past = run(past, picture, error, STILL)
        if i == 0:
            np.testing.assert_array_equal(past.picture, picture)
    best = off(np.mean([picture for picture, _ in frames], axis=0), truth())
    alone = off(frames[-1][0], truth())
    assert best < off(past.picture, truth()) < min(2 * best, 0.5 * alone)


def test_a_change_is_followed_at_once_where_it_is_and_there_only(run: Follow) -> None:
    random, past = np.random.default_rng(1), nothing()
    for _ in range(10):
        past = run(past, *noisy(random, 0.05), STILL)
    picture, error = noisy(random, 0.05)
    picture[:, :20] *= 3
    after = run(past, picture, error, STILL).picture
    np.testing.assert_allclose(after[:, :20], picture[:, :20], rtol=0.15)
    alone = off(picture[:, 24:], truth()[:, 24:])
    assert off(after[:, 24:], truth()[:, 24:]) < 0.65 * alone


def test_the_mean_is_as_certain_as_variances_add(run: Follow) -> None:
    """Against the formula of weighted means, of pictures that agree."""
    picture, error = truth(), 0.1 * truth().mean(-1, keepdims=True)
    past = run(nothing(), picture, error, STILL)
    variance = 1 / past.certainty.astype(float)
    again = run(past, picture, error, STILL)
    np.testing.assert_allclose(1 / again.certainty, variance / 2, rtol=1e-4)
    for _ in range(200):
        again = run(again, picture, error, STILL)
    np.testing.assert_allclose(1 / again.certainty, variance * LEAST / (2 - LEAST), rtol=1e-3)
    assert 0 < EXPLAINED <= 1


def test_light_of_another_unit_gives_the_same(run: Follow) -> None:
    for unit in (1e-12, 1.0, 1e15):
        random, past = np.random.default_rng(2), nothing()
        for _ in range(4):
            picture, error = noisy(random, 0.2)
            past = run(past, unit * picture, unit * error, STILL)
        if unit == 1e-12:
            right = past.picture / unit
        np.testing.assert_allclose(past.picture / unit, right, rtol=1e-3, atol=1e-5)


def test_what_was_not_there_is_as_the_frame_alone(run: Follow) -> None:
    """Beyond the border, where motion is unknown, and where nothing was known."""
    random = np.random.default_rng(3)
    past = run(nothing(), *noisy(random, 0.1), STILL)
    certainty = past.certainty.copy()
    certainty[30:] = 0
    motion = STILL + np.float32([4, 0])
    motion[:5] = np.nan
    picture, error = noisy(random, 0.1)
    after = run(past._replace(certainty=certainty), picture, error, motion).picture
    for new in (np.s_[:5], np.s_[31:], np.s_[:, -4:]):
        np.testing.assert_array_equal(after[new], np.maximum(picture[new], 0))
    assert not np.any(after[6:29, : WIDTH - 5] == picture[6:29, : WIDTH - 5])


def test_pixels_that_are_not_finite_stay_alone(run: Follow) -> None:
    random, past = np.random.default_rng(4), nothing()
    for i in range(3):
        picture, error = noisy(random, 0.1)
        if i == 1:
            picture[10, 12], picture[20, 22, 0], error[30, 32] = np.nan, np.inf, np.nan
            bad = picture
        past = run(past, picture, error, STILL)
        if i == 1:
            np.testing.assert_array_equal(past.picture[[10, 20, 30], [12, 22, 32]],
                                          bad[[10, 20, 30], [12, 22, 32]])  # fmt: skip
    assert np.isfinite(past.picture).all()
    np.testing.assert_array_equal(past.picture[10, 12], picture[10, 12])


@pytest.mark.parametrize("light", [0.0, 1e-38, 1.0, 1e37])
def test_any_light_and_any_past_leave_numbers(run: Follow, light: float) -> None:
    """Also a past that a file was damaged to say."""
    random = np.random.default_rng(8)
    past = Past(*(image.copy() for image in run(nothing(), *noisy(random, 0.1), STILL)))
    for image, bad in ((past.picture, np.nan), (past.picture, 3e38), (past.certainty, np.inf)):
        image.flat[:: random.integers(5, 50)] = bad
    past.certainty[5], past.certainty[6], past.certainty[7] = -1, np.nan, 3e38
    past.picture[20:26, 20:30] = 3e38
    picture, error = noisy(random, 0.1)
    for _ in range(2):
        past = run(past, np.float32(light) * picture, np.float32(light) * error, STILL)
        assert np.isfinite(past.picture).all() and np.isfinite(past.certainty).all()
    if light == 1:
        inner = np.s_[21:25, 21:29]
        np.testing.assert_allclose(past.picture[inner], picture[inner], rtol=0.02)


def test_alpha_goes_along(run: Follow) -> None:
    random, past = np.random.default_rng(5), nothing(4)
    pictures = []
    for _ in range(6):
        picture, error = noisy(random, 0.1, 4)
        past = run(past, picture, error, STILL)
        pictures.append(picture)
    alone = np.abs(pictures[-1] - truth(4)).mean((0, 1))
    assert np.all(np.abs(past.picture - truth(4)).mean((0, 1)) < 0.7 * alone)


def test_a_state_of_something_else_is_refused() -> None:
    image = np.ones((HEIGHT, WIDTH, 3), np.float32)
    layers = {"indirect": image, "normal": image, "depth": image[..., :1], "motion": STILL}
    light, seen = jflnr.Frame(**layers, ao=image[..., :1]), {"beauty": image, "seen_albedo": image}
    whole = jflnr.Frame(**layers, **seen)
    with pytest.raises(ValueError, match="the state is not of method picture"):
        temporal.step(temporal.start(light), whole, "picture")
    with pytest.raises(ValueError, match="the state is not of method flr"):
        temporal.step(temporal.start(whole), light, "flr")
    film = jflnr.Frame(**layers, **seen, alpha=image[..., :1])
    with pytest.raises(ValueError, match=r"of shape \(40, 56, 3\), and this one is \(40, 56, 4\)"):
        temporal.step(temporal.start(whole), film)


@pytest.mark.parametrize("by", [(3, -2), (0.5, 0.25)])
def test_the_past_is_moved_with_the_surfaces(by: tuple[float, float]) -> None:
    """Ramps come out exactly at any place between pixels, all else at whole ones."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    whole = all(float(step).is_integer() for step in by)
    image = np.random.default_rng(6).random((HEIGHT, WIDTH)) if whole else 100 + 2 * x - y
    past = Past(np.float32(image)[..., None], np.ones((HEIGHT, WIDTH, 1), np.float32))
    moved = moved_to(past, STILL + np.float32(by))
    inner = np.s_[4:-4, 4:-4]
    if whole:
        expected = np.roll(image, (2, -3), (0, 1))
    else:
        expected = 100 + 2 * (x + by[0]) - (y + by[1])
    np.testing.assert_allclose(moved.picture[..., 0][inner], expected[inner], rtol=1e-5)
    assert np.all(moved.certainty[inner] == 1)


def test_both_back_ends_agree() -> None:
    """Over frames that move, change, and have holes; in float64 nothing else comes out."""
    random = np.random.default_rng(7)
    try:
        context = Context()
    except NoDevice as error:
        pytest.skip(str(error))
    here: Any = nothing(4)
    there = Past(*(context.array(np.array(image)) for image in here))
    exact: Any = here
    for i in range(5):
        picture, error = noisy(random, 0.2, 4)
        picture[:, 30:] *= 1 + (i == 3)
        picture[5:8, 5:8] = np.nan if i == 2 else picture[5:8, 5:8]
        motion = (STILL + random.uniform(-3, 3, 2) + random.normal(0, 0.1, STILL.shape)).astype(
            "f4"
        )
        motion[20, :9] = np.nan
        here = follow(here, picture, error, motion)
        there = follow_on_device(context, there, picture, error, motion)
        with jax.enable_x64(True):
            wide = (np.float64(a) for a in (picture, error, motion))
            exact = Past(*map(np.asarray, follow(exact, *wide)))
        for found in (here, Past(*(image.get() for image in there))):
            np.testing.assert_allclose(found.picture, exact.picture, rtol=1e-3, atol=1e-4)
            np.testing.assert_allclose(found.certainty, exact.certainty, rtol=2e-2)
