"""Every kernel alone against the JAX function of the same step in float64."""

import numpy as np
import pytest

from jflnr.images import guides
from jflnr.opencl import Context
from jflnr.opencl.apply import apply
from jflnr.opencl.blur import blur
from jflnr.opencl.moments import centre, collect
from jflnr.opencl.shrink import shrink
from jflnr.opencl.solve import solve
from jflnr.regression import apply as jax_apply
from jflnr.regression import blur as jax_blur
from jflnr.regression import moments as jax_moments
from jflnr.regression import solve as jax_solve
from tests.opencl import tolerances
from tests.opencl.conftest import PARAMETERS, error, in_float64, scene

# Guides and channels, size of the image, block.
CASES = [
    ((0, 3), (37, 83), 8),
    ((4, 4), (37, 83), 8),
    ((5, 3), (37, 83), 8),
    ((12, 3), (37, 83), 8),
    ((5, 3), (1, 1), 8),
    ((5, 3), (7, 9), 3),
]


def padded(context: Context, planes: np.ndarray) -> np.ndarray:
    """`(..., h, w)` with zeros up to the pitch of the kernels' layout."""
    missing = -planes.shape[-1] % context.width()
    return np.pad(planes, [(0, 0)] * (planes.ndim - 1) + [(0, missing)]).astype(np.float32)


def per_plane(found: np.ndarray, right: np.ndarray) -> float:
    return max(error(a, b) for a, b in zip(found, right, strict=True))


@pytest.mark.parametrize(("counts", "size", "block"), CASES)
def test_moments(
    context: Context, counts: tuple[int, int], size: tuple[int, int], block: int
) -> None:
    target, guides = scene(*size, *counts)
    shift = np.full(max(counts[0], 1), 0.25, np.float32)
    layers = (context.array(guides),) if counts[0] else ()
    found = collect(context, context.array(target), layers, context.array(shift), block).get()
    right = in_float64(jax_moments.collect, block=block)(target, guides, shift[: counts[0]])
    width = right.shape[2]
    assert per_plane(found[..., :width], right) < tolerances.MOMENTS
    assert not found[..., width:].any()


@pytest.mark.parametrize("kind", ["float", "mask"])
def test_moments_with_weights(context: Context, kind: str) -> None:
    target, guides = scene(37, 83, 5, 3)
    weight = np.random.default_rng(1).normal(0.5, 1, (37, 83)).astype(np.float32)
    weight[3, 4:7] = np.nan, np.inf, 0
    target[9, 5], guides[10, 70, 2], target[36, 82] = np.inf, np.nan, -np.inf
    if kind == "mask":
        weight = weight > 0
    shift = np.zeros(5, np.float32)
    arrays = [context.array(a) for a in (target, guides, shift, weight)]
    found = collect(context, arrays[0], (arrays[1],), arrays[2], 8, arrays[3]).get()
    right = in_float64(jax_moments.collect, block=8)(target, guides, shift, weight=weight)
    assert per_plane(found[..., : right.shape[2]], right) < tolerances.MOMENTS


@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_centre(context: Context, offset: float) -> None:
    guides = scene(70, 131, 5, 3)[1] + np.float32(offset)
    guides[2, :9] = np.nan
    guides[:, :, 4] = np.inf
    weight = np.arange(131)[None] + np.zeros((70, 1), np.float32) > 60
    found = centre(context, (context.array(guides),)).get()
    assert error(found, in_float64(jax_moments.centre)(guides)) < 1e-6
    found = centre(context, (context.array(guides),), context.array(weight)).get()
    assert error(found, in_float64(jax_moments.centre)(guides, weight)) < 1e-6


@pytest.mark.parametrize(
    ("size", "sigma", "reach"), [((1, 1), 2.0, 9), ((23, 40), 2.0, 9), ((5, 11), 1e-3, 1)]
)
def test_blur(context: Context, size: tuple[int, int], sigma: float, reach: int) -> None:
    planes = np.random.default_rng(0).normal(0, 1, (3, *size)).astype(np.float32)
    found = blur(context, context.array(padded(context, planes)), sigma, reach).get()
    right = in_float64(jax_blur.blur, sigma=sigma, reach=reach)(planes)
    assert per_plane(found[..., : size[1]], right) < tolerances.BLUR


@pytest.mark.parametrize("counts", [(4, 4), (5, 3), (12, 3)])
def test_solve(context: Context, counts: tuple[int, int]) -> None:
    # Independent guides: of others only what the model predicts is well determined.
    target = scene(64, 83, *counts)[0]
    guides = np.random.default_rng(0).normal(0, 1, (64, 83, counts[0])).astype(np.float32)
    shift = np.full(counts[0], 0.25, np.float32)
    moments = in_float64(jax_moments.collect, block=8)(target, guides, shift)
    moments = in_float64(jax_blur.blur, sigma=1.5, reach=5)(moments).astype(np.float32)
    moments[:, 3, 4] = 0  # a window without pixels
    found = solve(
        context,
        context.array(padded(context, moments)),
        context.array(shift),
        PARAMETERS,
        *counts,
    ).get()[..., : moments.shape[2]]
    right = in_float64(jax_solve.solve, method=PARAMETERS, channels=counts[1])(moments, shift)
    assert per_plane(found, right) < tolerances.SOLVE
    assert not found[..., 3, 4].any()


@pytest.mark.parametrize(("counts", "size", "step"), CASES)
def test_apply(context: Context, counts: tuple[int, int], size: tuple[int, int], step: int) -> None:
    guides = scene(*size, *counts)[1]
    blocks = -(-size[0] // step), -(-size[1] // step)
    random = np.random.default_rng(0)
    model = random.normal(0, 1, (counts[0] + 1, counts[1], *blocks)).astype(np.float32)
    shift = np.full(max(counts[0], 1), 0.25, np.float32)
    if counts[0]:
        guides[-1, -1, -1] = np.nan
    image = np.full((*size, counts[1]), np.nan, np.float32)
    apply(
        context,
        context.array(padded(context, model)),
        (context.array(guides),) if counts[0] else (),
        context.array(shift),
        step,
        (*blocks, padded(context, model).shape[-1]),
        context.array(image, writable=True),
    )
    context.queue.finish()
    right = in_float64(jax_apply.apply, block=step)(model, guides, shift[: counts[0]])
    assert error(image, right) < tolerances.APPLY


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_shrink(context: Context, dtype: type, masked: bool) -> None:
    _, image = scene(37, 83, 4, 1)
    image, mask = image.astype(dtype), (image[..., :1] > 0).astype(np.float32) if masked else None
    right = guides.shrink(image.astype(np.float64), 3, mask)
    assert error(shrink(image, 3, mask, context=context).get(), right) < 1e-6
