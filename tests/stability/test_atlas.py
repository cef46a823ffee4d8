"""The bar of the atlas on every case: finite, in range, near the exact answer."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.stability import SIZE
from experiments.stability.cases import CASES, make
from experiments.stability.measures import measure, passes
from experiments.stability.methods import EXACT, METHODS, ON_DEVICE
from jflnr.opencl.flr import flr as on_device
from jflnr.regression.flr import FLR, flr

MANY = "16 guides, rank 5"
FIVE_GUIDES = [case for case in CASES if case != MANY]
# These solve other problems than that of the exact answer.
OTHERS = ("ours, adaptive", "ours, adaptive OpenCL", "ours, FLNR", "ours, BMFR's fit")


@functools.cache
def exact(name, storage):
    """A case and the float64 answer to its regularised problem."""
    case = make(name, *SIZE, storage)
    with np.errstate(all="ignore"):
        return case, EXACT(case, np.float64)


def clears_the_bar(method, storage, case):
    if method in ON_DEVICE:
        _needs_a_device()
    made, truth = exact(case, storage)
    result = METHODS[method](made, np.float32)
    assert np.isfinite(result).all(), "also outside the mask"
    figures = measure(made, result, truth, truth)
    assert passes(figures), figures
    # Far below the noise: the rounding of float32, grown by the condition that eps' allows.
    # Subnormal numbers count as 0 on some devices.
    assert figures["rounding"] < 1e-4 or case == "subnormal radiance" or method in OTHERS


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize("storage", [np.float32, np.float16])
@pytest.mark.parametrize(
    ("method", "case"),
    [
        *(("ours, Cholesky", case) for case in CASES),
        *(("ours, OpenCL", case) for case in CASES),
        *(("ours, BMFR's fit", case) for case in CASES),
        *(("ours, adaptive", case) for case in FIVE_GUIDES),
    ],
)
def test_ours_clears_the_bar(method, storage, case):
    clears_the_bar(method, storage, case)


@pytest.mark.slow  # compiles long
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize("storage", [np.float32, np.float16])
@pytest.mark.parametrize(
    ("method", "case"),
    [
        *(("ours, block inverse", case) for case in CASES),
        *(("ours, adaptive OpenCL", case) for case in CASES),
        *(("ours, FLNR", case) for case in FIVE_GUIDES),
        ("ours, adaptive", MANY),
    ],
)
def test_ours_clears_the_bar_too(method, storage, case):
    clears_the_bar(method, storage, case)


def _needs_a_device():
    from jflnr.opencl import NoDevice
    from jflnr.opencl.context import default_context

    try:
        default_context()
    except NoDevice as error:
        pytest.skip(str(error))


# Without any regularisation only rounding says how much of a variance is known; the largest says
# whether eps and eps' are cut before they overflow.
LOGARITHMS = [(2.0, -1e3, -1e3), (2.0, 1e3, 1e3)]


@pytest.mark.parametrize("logarithms", LOGARITHMS)
@pytest.mark.parametrize("size", [1e-13, 1e4, 1e13])
def test_equal_guides_without_regularisation(rng, size, logarithms):
    y = rng.random((11, 13, 1), np.float32)
    x = np.repeat(size * rng.standard_normal((11, 13, 1)), 2, axis=-1).astype(np.float32)
    with np.errstate(over="ignore"):
        method = FLR(*np.exp(np.float32(logarithms)))
    light, slopes = _unregularised()(y, x, method)
    assert np.isfinite(light).all() and np.abs(light).max() < 3
    assert all(np.isfinite(slope).all() for slope in jax.tree.leaves(slopes))
    _needs_a_device()
    light = on_device(y, x, method, block=4, support=16)
    assert np.isfinite(light).all() and np.abs(light).max() < 3


@functools.cache
def _unregularised():
    fit = functools.partial(flr, block=4, support=16)
    slopes = jax.grad(lambda *a: jnp.mean(fit(*a)), argnums=(0, 1, 2))
    return jax.jit(lambda *a: (fit(*a), slopes(*a)))


def test_the_measures_notice_each_kind_of_failure():
    case, truth = exact("ordinary", np.float32)
    light = np.repeat(np.float64(case.target[..., 1:]), 2, -1)
    assert passes(measure(case, truth, truth, truth))
    assert measure(case, truth, truth, truth)["error"] == pytest.approx(1)
    for spoil in (np.nan, np.inf, 1e3):
        bad = truth.copy()
        bad[3, 4, 0] = spoil
        assert not passes(measure(case, bad, truth, truth))
    offset = light + 0.5 * np.ptp(case.target[..., 0])
    figures = measure(case, offset, truth, truth)
    assert figures["bias"] == pytest.approx(0.5) and figures["bleeding"] > 0.5
    assert not passes(figures)
