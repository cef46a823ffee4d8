"""The guided filter against a direct one in numpy and scipy."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from experiments.peers import guided
from experiments.peers.windows import box


def test_box_is_the_sum_over_a_square(rng):
    image = rng.standard_normal((11, 8, 2))
    with jax.enable_x64(True):
        ours = np.asarray(box(jnp.asarray(image), 3))
    for channel in range(2):
        truth = 49 * uniform_filter(image[..., channel], 7, mode="constant")
        np.testing.assert_allclose(ours[..., channel], truth, atol=1e-12)


def mean_over_windows(image, radius):
    """Means over the part of each window inside the frame, by scipy."""
    size = 2 * radius + 1
    ones = uniform_filter(np.ones(image.shape[:2]), size, mode="constant")
    flat = image.reshape(*image.shape[:2], -1)
    planes = [uniform_filter(flat[..., k], size, mode="constant") for k in range(flat.shape[-1])]
    return (np.stack(planes, -1) / ones[..., None]).reshape(image.shape)


def guided_by_numpy(x, y, radius, eps):
    """He et al. (2010), equations 14 to 16, for several guide channels."""
    mean = lambda image: mean_over_windows(image, radius)
    mean_x, mean_y = mean(x), mean(y)
    covariance = (
        mean(x[..., :, None] * x[..., None, :]) - mean_x[..., :, None] * mean_x[..., None, :]
    )
    cross = mean(x[..., :, None] * y[..., None, :])
    cross -= mean_x[..., :, None] * mean_y[..., None, :]
    slopes = np.linalg.solve(covariance + eps * np.eye(x.shape[-1]), cross)
    offset = mean_y - np.einsum("hwq,hwqc->hwc", mean_x, slopes)
    return np.einsum("hwq,hwqc->hwc", x, mean(slopes)) + mean(offset)


@pytest.mark.parametrize("radius", [1, 5])
def test_models_against_numpy(rng, radius):
    x, y = rng.standard_normal((14, 17, 3)), rng.standard_normal((14, 17, 3))
    with jax.enable_x64(True):
        arrays = map(jnp.asarray, (x, y, np.ones((14, 17, 1))))
        slopes, offset = guided.models(*arrays, radius, 0.01)
        ours = np.asarray(guided.evaluate(slopes, offset, jnp.asarray(x)))
    np.testing.assert_allclose(ours, guided_by_numpy(x, y, radius, 0.01), atol=1e-10)


def test_denoise_against_numpy(frame):
    ours = guided.denoise(frame, guides=("normal", "depth"), radius=6, eps=0.01)
    median = np.median(frame.depth)
    x = np.concatenate([frame.normal, frame.depth / median], -1).astype(np.float64)
    truth = guided_by_numpy(x, np.asarray(frame.indirect, np.float64), 6, 0.01)
    np.testing.assert_allclose(ours, truth, rtol=2e-4)


@pytest.mark.parametrize("average", [True, False])
def test_fast_form_comes_close_on_smooth_images(frame, average):
    smooth = dataclasses.replace(frame, indirect=frame.reference)
    options = {"guides": ("normal", "depth"), "radius": 8, "eps": 0.01}
    exact = np.asarray(guided.denoise(smooth, **options))
    fast = np.asarray(guided.denoise(smooth, **options, subsample=2, average=average))
    assert fast.shape == exact.shape
    assert np.abs(fast - exact).max() < 0.05
