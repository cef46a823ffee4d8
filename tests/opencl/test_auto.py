"""Method auto in OpenCL against JAX: numbers of guides, awkward pixels, tiles left coarse."""

import functools

import jax
import numpy as np
import pytest

from jflnr.opencl import Context
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.regression.adaptive import flr_adaptive as jax_adaptive
from jflnr.regression.auto import Auto
from tests.opencl import tolerances
from tests.opencl.conftest import error, scene

SIZE = (61, 203)
# Tiles of the scene have 0.1 to 0.9 of signal.
METHOD = Auto(worth=0.5, exponent=0.8)


# Guides that the JAX program is compiled for. One that is zero changes nothing.
MOST = 8
by_jax = jax.jit(functools.partial(jax_adaptive, method=METHOD, with_error=True))


def striped(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A scene with detail on its right, so that some tiles are refined."""
    target, guides = scene(*SIZE, count, 3)
    target[:, 120:] *= 1 + np.sin(np.arange(SIZE[1] - 120) / 2).astype(np.float32)[:, None]
    return target, guides


@pytest.mark.parametrize("count", [1, 5, 8])
@pytest.mark.parametrize("width", ["vectors", "single"])
def test_is_what_jax_gives(context: Context, gpu_like: Context, width: str, count: int) -> None:
    device = context if width == "vectors" else gpu_like
    target, guides = striped(count)
    weight = np.random.default_rng(0).integers(1, 4, SIZE).astype(np.float32)
    weight[:24, :70] = 0
    target[30, 31], target[31, 150, 1], guides[32, 33, 0] = np.nan, np.inf, np.nan
    found = flr_adaptive(target, guides, METHOD, weight=weight, context=device, with_error=True)
    guides = np.pad(guides, ((0, 0), (0, 0), (0, MOST - count)))
    for one, other in zip(found, by_jax(target, guides, weight=weight), strict=True):
        assert error(one, np.asarray(other)) < tolerances.ADAPTIVE


def test_weights_count_relative_to_each_other(context: Context) -> None:
    run = functools.partial(flr_adaptive, *striped(5), METHOD, context=context)
    assert error(run(weight=np.full(SIZE, 4, np.float32)), run()) < 1e-5


def test_some_tiles_are_refined_and_others_are_not(context: Context) -> None:
    run = functools.partial(flr_adaptive, *striped(5), METHOD, context=context)
    found, none, everywhere = run(), run(worth=1.0), run(worth=1e-9)
    assert error(found, none) > 0.01 and error(found, everywhere) > 0.01
