"""Shots, `select` and method bmfr on arrays of any shape, type and value."""

import functools

import jax
import jax.numpy as jnp
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
    layers = {"indirect": 3, "albedo": 3, "normal": 3, "depth": 1, "motion": 2}
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
    {"indirect": image(3), "normal": image(3), "depth": image(1), "motion": image(2)}
)


@functools.cache
def shot(method):
    """A bad frame, then an ordinary one."""
    start, step = (bmfr.start, bmfr.step) if method == "bmfr" else (temporal.start, temporal.step)
    options = {} if method == "bmfr" else {"method": method, "guides": ("normal", "depth")}

    def two(bad):
        frame = ordinary()
        frames = Frame(**(vars(frame) | bad)), jax.tree.map(jnp.asarray, frame)
        state, first = step(start(frames[0]), frames[0], **options)
        return first, step(state, frames[1], **options)[1]

    return jax.jit(two)


def a_bad_frame_does_no_harm(method, bad):
    """Nor NaN where light is finite, nor does it poison what comes after it."""
    light = bad["indirect"]
    if np.abs(np.nan_to_num(light, posinf=0, neginf=0)).max() < 1e15:
        first, second = shot(method)(bad)
        assert np.isfinite(first).all() and np.isfinite(second).all()


@pytest.mark.parametrize("method", ["bmfr", "flr"])
@short(max_examples=60, suppress_health_check=[HealthCheck.large_base_example])
@given(BAD)
def test_a_bad_frame(method, bad):
    a_bad_frame_does_no_harm(method, bad)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["bmfr", "flr", "flr-adaptive"])
@long(max_examples=5000)
@given(BAD)
def test_a_bad_frame_long(method, bad):
    a_bad_frame_does_no_harm(method, bad)
