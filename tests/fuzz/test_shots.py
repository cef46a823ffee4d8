"""Shots, `select` and method bmfr on arrays of any shape, type and value."""

import functools

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

import jflnr
from jflnr import temporal
from jflnr.bmfr import pipeline as bmfr
from jflnr.frame import Frame
from tests.fuzz.test_arrays import ANYTHING, FRAMES, HEIGHT, WIDTH, image, long, refused, short

SIZE = HEIGHT, WIDTH


def ordinary() -> Frame:
    rng = np.random.default_rng(0)
    layers = {"indirect": 3, "albedo": 3, "normal": 3, "depth": 1, "ao": 1, "motion": 2}
    return Frame(**{n: rng.random((*SIZE, c), np.float32) + 0.1 for n, c in layers.items()})


WRONG = st.tuples(
    FRAMES.filter(lambda f: getattr(f["normal"], "shape", ()) != (8, 9, 3)),
    st.one_of(st.none(), ANYTHING),
)
OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        "method": st.sampled_from(["flr", "flnr-small", "bmfr", "auto", "", None, 3]),
        "guides": st.sampled_from([(), ("normal",), ("depth", "depth"), ("colour",)]),
        "sigma": st.sampled_from([{}, 1.0, bmfr.PAPER, (0.0, 0.0, 0.0)]),
    },
)


def every_call_refuses(wrong, options):
    layers, motion = wrong
    frame = Frame(**layers, motion=motion)
    fine = ordinary()
    calls = [
        lambda: temporal.step(temporal.start(fine), frame, **options),
        lambda: temporal.step(temporal.start(frame), fine),
        lambda: bmfr.step(bmfr.start(fine), frame),
        lambda: jflnr.denoise(frame, "bmfr"),
    ]
    for call in calls:
        with pytest.raises((ValueError, TypeError)) as caught:
            call()
        assert refused(caught.value), caught.value


@short(max_examples=40)
@pytest.mark.filterwarnings("ignore:The frame has no ao layer")
@given(WRONG, OPTIONS)
def test_wrong_frames_are_refused(wrong, options):
    every_call_refuses(wrong, options)


@pytest.mark.slow
@long(max_examples=5000)
@pytest.mark.filterwarnings("ignore:The frame has no ao layer")
@given(WRONG, OPTIONS)
def test_wrong_frames_are_refused_long(wrong, options):
    every_call_refuses(wrong, options)


BAD = st.fixed_dictionaries(
    {n: image(c) for n, c in (("indirect", 3), ("normal", 3), ("depth", 1), ("motion", 2))},
    optional={"albedo": image(3)},
)


@functools.cache
def denoiser(method, backend):
    return jflnr.Denoiser(method, backend=backend)


def a_bad_frame_does_no_harm(method, backend, bad):
    """No NaN where light is finite, nor in the ordinary frame that comes after it."""
    light = bad["indirect"]
    if np.abs(np.nan_to_num(light, posinf=0, neginf=0)).max() < 1e15:
        frame, denoise = ordinary(), denoiser(method, backend)
        denoise.state, shot = None, (Frame(**(vars(frame) | bad)), frame)
        try:
            pictures = [denoise(shot[0]), *map(denoise.next, shot)]
        except ValueError as error:
            assert not np.isfinite(light).all(-1).any() and refused(error)
        else:
            assert np.isfinite(pictures).all()


@pytest.mark.parametrize("method", ["bmfr", "flr"])
@short(
    max_examples=60,
    suppress_health_check=[HealthCheck.large_base_example, HealthCheck.function_scoped_fixture],
)
@given(BAD)
def test_a_bad_frame(method, backend, bad):
    a_bad_frame_does_no_harm(method, backend, bad)


@pytest.mark.parametrize("method", ["bmfr", "flr"])
def test_the_largest_number_fades(method, backend):
    frame, denoise = ordinary(), denoiser(method, backend)
    light = frame.indirect.copy()
    light[3:5, 4:6] = np.finfo(np.float32).max
    denoise.state = None
    shot = [Frame(**(vars(frame) | {"indirect": light})), *[frame] * 60]
    largest = [denoise.next(each).max() for each in shot]
    assert largest[0] > 1e36 and largest[-1] < 1e-2 * largest[0]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["bmfr", "flr", "flr-adaptive", "auto", "flnr"])
@long(max_examples=5000)
@given(BAD)
def test_a_bad_frame_long(method, backend, bad):
    a_bad_frame_does_no_harm(method, backend, bad)
