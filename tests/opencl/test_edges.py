"""The filter along edges, and what stands before and after it, against the twins in JAX."""

import numpy as np
import pytest

from jflnr.opencl import Context
from jflnr.opencl.detail import composed
from jflnr.opencl.edges import average, filter_layers
from jflnr.regression import features, picture
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


SIZES = [(37, 83), (3, 5), (1, 1)]


@pytest.mark.parametrize("kind", ["context", "gpu_like"])
@pytest.mark.parametrize("size", SIZES)
def test_average(kind: str, size: tuple[int, int], request: pytest.FixtureRequest) -> None:
    given = layers(*size)
    for k, planes in enumerate(average(request.getfixturevalue(kind), *given)):
        right = in_float64(lambda *arrays, k=k: features.average(*arrays)[k])(*given)
        assert error(planes.get(), right) < tolerances.EDGES


def test_what_does_not_count_does_no_harm(context: Context) -> None:
    steer, follow, usable, alike = layers(20, 30)
    right = average(context, steer, np.where(usable, follow, 0), usable, alike)
    follow[:, ~usable] = np.nan
    for found, wanted in zip(average(context, steer, follow, usable, alike), right, strict=True):
        np.testing.assert_array_equal(found.get(), wanted.get())
    number, none = average(context, steer, follow, np.zeros_like(usable), alike)
    assert not none.get().any()
    assert np.isfinite(number.get()).all()


def of_a_picture(height: int, width: int) -> dict[str, np.ndarray]:
    """Layers with edges of few samples, some far brighter than white, and pixels of no number."""
    random = np.random.default_rng(width)
    y, x = np.mgrid[:height, :width][..., None]
    share = ((x + y // 2) // 9 % 2 + 0.3 * random.random((height, width, 4))).astype(np.float32)
    found = {
        "albedo": share[..., :3] * (1 + 30 * (x > width // 2)),
        "normal": share[..., 1:] - 0.5,
        "depth": x + random.random((height, width, 1)),
        "emission": 50 * share[..., :3] * (y > height // 2),
        "alpha": share[..., 3:] / 1.3,
    }
    for k, layer in enumerate(found.values()):
        layer[k * height // 5, k * width // 5] = (np.nan, np.inf)[k % 2]
    # In the order in which JAX hands them on.
    return {name: found[name].astype(np.float32) for name in sorted(found)}


@pytest.mark.parametrize("kind", ["context", "gpu_like"])
@pytest.mark.parametrize("size", SIZES[:2])
def test_layers(kind: str, size: tuple[int, int], request: pytest.FixtureRequest) -> None:
    given, unit = of_a_picture(*size), np.float32(2.5)
    samples = np.random.default_rng(5).uniform(1, 9, (*size, 1)).astype(np.float32)
    found = filter_layers(given, unit, samples, request.getfixturevalue(kind))
    for k, layer in enumerate(found):
        wanted = in_float64(lambda *a, k=k: picture.filter_layers(*a)[k])(given, unit, samples)
        assert error(layer, wanted) < tolerances.EDGES


@pytest.mark.parametrize("kind", ["context", "gpu_like"])
@pytest.mark.parametrize("size", SIZES)
def test_the_picture_with_its_detail(
    kind: str, size: tuple[int, int], request: pytest.FixtureRequest
) -> None:
    random = np.random.default_rng(3)
    target, surface = random.gamma(4, 0.25, (2, *size, 3)).astype(np.float32)
    light = (1 + 0.1 * random.random((*size, 3))).astype(np.float32)
    target[..., 0] *= 1 + (np.arange(size[1]) // 11 % 2)
    own = (20 * (random.random((*size, 3)) > 0.9)).astype(np.float32)
    brightness = np.full((size[0], 1, 1), 1.5, np.float32)
    weight = random.random(size).astype(np.float32)
    target[size[0] // 2, 0] = np.nan
    named = {"target": target, "image": light, "surface": surface, "own": own, "weight": weight}
    found = composed(named | {"brightness": brightness}, request.getfixturevalue(kind))
    wanted = in_float64(picture.composed)(named | {"brightness": brightness})
    assert error(found, wanted) < tolerances.EDGES
    light[0, 0] = np.nan
    unknown = composed(named | {"brightness": brightness}, request.getfixturevalue(kind))
    assert np.isnan(unknown[0, 0]).all()
