"""A device for the tests of this folder; without one they are skipped and say why."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
import pytest

from jflnr.opencl import Context, NoDevice
from jflnr.regression.flr import FLR

PARAMETERS = FLR(sigma=12.0, eps=1e-3, eps_prime=1e-4)


@pytest.fixture(scope="session")
def context() -> Context:
    try:
        return Context()
    except NoDevice as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def gpu_like() -> Context:
    """The same device driven as a GPU is: one pixel per work-item, arrays copied both ways."""
    try:
        context = Context(work_group=8)
    except NoDevice as error:
        pytest.skip(str(error))
    context.on_cpu = False
    return context


def scene(
    height: int, width: int, guides: int, channels: int, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Target `(H, W, C)` and guides `(H, W, Q)` of the look of a frame: noise over smooth parts."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width][..., None]
    phase = random.uniform(0, 6, guides)
    guide = np.sin(x / 7 + phase) + (y > height / 2) * np.cos(phase) + random.normal(0, 0.01)
    target = random.exponential(1, (height, width, channels)) * (1 + (x > width / 3))
    return target.astype(np.float32), guide.astype(np.float32)


def in_float64(function: Callable[..., Any], **static: Any) -> Callable[..., np.ndarray]:
    """The JAX function, compiled once, of numpy arrays (and tuples of them) in float64."""
    program = jax.jit(functools.partial(function, **static))

    def widen(values: Any) -> Any:
        floating = isinstance(values, np.ndarray) and values.dtype != bool
        return values.astype(np.float64) if floating else values

    def call(*arrays: Any, **named: Any) -> np.ndarray:
        with jax.enable_x64(True):
            arrays, named = jax.tree.map(widen, (arrays, named))
            return np.asarray(program(*arrays, **named))

    return call


def error(found: np.ndarray, right: np.ndarray) -> float:
    """Largest difference, relative to the largest magnitude."""
    assert found.shape == right.shape
    assert np.isfinite(found).all()
    return float(np.abs(found - right).max(initial=0) / max(np.abs(right).max(initial=0), 1e-30))
