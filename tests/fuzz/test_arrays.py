"""Arrays of any shape, type and value: an answer of the right form, or one sentence."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import jflnr
from jflnr.frame import Frame
from jflnr.regression.flr import DEFAULT, FLR, flr

short = functools.partial(settings, deadline=None, derandomize=True, database=None)
long = functools.partial(
    settings, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)

TYPES = st.sampled_from("e f d b B i q ? F O U1 M8[s]".split())
SHAPES = st.one_of(
    st.lists(st.sampled_from([0, 1, 2, 3, 8]), max_size=4).map(tuple),
    st.sampled_from([(8, 9, 2), (8, 9, 3), (8, 9, 0), (16, 18, 2), (7, 9, 2), (8, 9)]),
)
ANYTHING = st.one_of(
    st.tuples(SHAPES, TYPES).map(lambda t: np.zeros(t[0], t[1])),
    st.sampled_from([None, 1, "guides", [], [[1.0]], {}]),
)


def refused(error):
    """Whether it says what is wrong in one sentence."""
    return isinstance(error, ValueError | TypeError) and 10 < len(str(error)) < 400


def try_flr(target, guides, weight, block, support):
    """Shapes and types only, which is what tracing sees; nothing is computed."""

    def traced(*arrays):
        return flr(*arrays[:2], DEFAULT, block=block, support=support, weight=arrays[2])

    try:
        whole = flr(target, guides, DEFAULT, block=-1)
    except (ValueError, TypeError) as error:
        assert refused(error)
    else:
        raise AssertionError(f"a block of -1 gave {whole}")
    arrays = (target, guides, weight)
    plain = [a for a in arrays if isinstance(a, np.ndarray) and a.dtype.kind in "fiub"]
    if len(plain) + (weight is None) < 3:
        with pytest.raises((ValueError, TypeError)) as caught:
            flr(target, guides, DEFAULT, block=block, support=support, weight=weight)
        assert refused(caught.value), caught.value
        return
    try:
        out = jax.eval_shape(traced, *arrays)
    except (ValueError, TypeError) as error:
        assert refused(error), error
    else:
        assert out.shape == target.shape and target.ndim == 3
        assert jnp.issubdtype(out.dtype, jnp.floating)


ARGUMENTS = st.tuples(
    ANYTHING,
    ANYTHING,
    st.one_of(st.none(), ANYTHING),
    st.sampled_from([1, 4, 8, 0, -3, 2.5, True, None, "8"]),
    st.sampled_from([8, 72, 0, None]),
)


@short(max_examples=60)
@given(ARGUMENTS)
def test_flr_takes_or_refuses(arguments):
    try_flr(*arguments)


@pytest.mark.slow
@long(max_examples=5000)
@given(ARGUMENTS)
def test_flr_takes_or_refuses_long(arguments):
    try_flr(*arguments)


HEIGHT, WIDTH = 11, 13
LARGEST = float(np.finfo(np.float32).max)
VALUES = st.one_of(
    st.floats(width=32),
    st.sampled_from([0.0, -0.0, 1.0, 1e-45, 1e-38, 1e15, 1e30, LARGEST / 64, -LARGEST / 64]),
)


def image(channels):
    return hnp.arrays(np.float32, (HEIGHT, WIDTH, channels), elements=VALUES, fill=VALUES)


@functools.cache
def _compiled():
    return jax.jit(lambda *a: flr(*a[:3], block=4, support=16, weight=a[3]))


def stays_a_number(y, x, weight, logs):
    """Whatever the values and numbers, also NaN and infinities: no NaN where light is finite.

    A sum may still leave float32 where radiance and guides are both huge, so infinities are allowed
    only there.
    """
    with np.errstate(over="ignore"):
        numbers = FLR(*np.exp(np.float32(logs)))
    out = np.asarray(_compiled()(y, x, numbers, weight))
    large = np.abs(np.nan_to_num(y, posinf=0, neginf=0)).max()
    if large < 1e15:
        assert np.isfinite(out).all()


NUMBERS = st.tuples(
    image(1),
    image(2),
    hnp.arrays(np.float32, (HEIGHT, WIDTH), elements=VALUES, fill=VALUES),
    st.tuples(*[st.one_of(st.floats(-20, 10), st.sampled_from([-1e3, 1e3, -88.0, 88.0]))] * 3),
)


@short(max_examples=150, suppress_health_check=[HealthCheck.large_base_example])
@given(NUMBERS)
def test_values_of_any_size(numbers):
    stays_a_number(*numbers)


@pytest.mark.slow
@long(max_examples=20000)
@given(NUMBERS)
def test_values_of_any_size_long(numbers):
    stays_a_number(*numbers)


FRAMES = st.fixed_dictionaries(
    {"indirect": ANYTHING, "albedo": ANYTHING, "normal": ANYTHING, "depth": ANYTHING},
    optional={"ao": ANYTHING, "mask": ANYTHING, "position": ANYTHING},
)


def denoise_refuses(layers, options):
    """Frames that are wrong somewhere; no random one is right in all its layers."""
    with pytest.raises((ValueError, TypeError)) as caught:
        jflnr.denoise(Frame(**layers), **options)
    assert refused(caught.value), caught.value


OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        "method": st.sampled_from(["flr", "", "FLR", None, 3]),
        "backend": st.sampled_from(["jax", "cuda", None]),
        "guides": st.sampled_from([(), ("normal",), ("depth", "depth"), ("colour",), ("ao",)]),
        "block": st.sampled_from([0, -1, 8, 2.0, None]),
    },
)


@short(max_examples=60)
@pytest.mark.filterwarnings("ignore:The frame has no ao layer")
@given(FRAMES.filter(lambda f: getattr(f["normal"], "shape", ()) != (8, 9, 3)), OPTIONS)
def test_denoise_refuses(layers, options):
    denoise_refuses(layers, options)


@pytest.mark.slow
@long(max_examples=5000)
@pytest.mark.filterwarnings("ignore:The frame has no ao layer")
@given(FRAMES.filter(lambda f: getattr(f["normal"], "shape", ()) != (8, 9, 3)), OPTIONS)
def test_denoise_refuses_long(layers, options):
    denoise_refuses(layers, options)
