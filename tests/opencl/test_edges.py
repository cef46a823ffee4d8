"""The filter along edges against its twin in JAX, in float64."""

import numpy as np
import pytest

from jflnr.opencl import Context
from jflnr.opencl.edges import average
from jflnr.regression import features
from tests.opencl import tolerances
from tests.opencl.conftest import error, in_float64


def layers(height: int, width: int) -> tuple[np.ndarray, ...]:
    """Steps under noise, what follows them, which pixels count, and how alike they must be."""
    random = np.random.default_rng(height)
    y, x = np.mgrid[:height, :width]
    steer = ((x + y // 2) // 9 % 2 + 0.1 * random.normal(size=(5, height, width))).astype(
        np.float32
    )
    follow = random.exponential(size=(7, height, width)).astype(np.float32)
    usable = random.random((height, width)) > 0.1
    return steer, follow, usable, random.uniform(0.1, 0.4, (height, width)).astype(np.float32)


@pytest.mark.parametrize("kind", ["context", "gpu_like"])
@pytest.mark.parametrize("size", [(37, 83), (3, 5), (1, 1)])
def test_average(kind: str, size: tuple[int, int], request: pytest.FixtureRequest) -> None:
    context: Context = request.getfixturevalue(kind)
    given = layers(*size)
    number, found = average(*given, context)
    for k, planes in enumerate((number, found)):
        right = in_float64(lambda *arrays, k=k: features.average(*arrays)[k])(*given)
        assert error(planes, right) < tolerances.EDGES


def test_what_does_not_count_does_no_harm(context: Context) -> None:
    steer, follow, usable, alike = layers(20, 30)
    right = average(steer, np.where(usable, follow, 0), usable, alike, context)
    follow[:, ~usable] = np.nan
    for found, wanted in zip(average(steer, follow, usable, alike, context), right, strict=True):
        np.testing.assert_array_equal(found, wanted)
    number, none = average(steer, follow, np.zeros_like(usable), alike, context)
    assert not none.any()
    assert np.isfinite(number).all()
