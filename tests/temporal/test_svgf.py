"""The peer SVGF over time, on the frame that ships."""

import dataclasses

import jax
import numpy as np
import pytest

import jflnr
from experiments.peers import svgf
from jflnr.denoising import SHIPPED_FRAME
from jflnr.frame import Frame


@pytest.fixture(scope="module")
def still() -> list[Frame]:
    """Frames of one view, each with noise of its own; nothing moves."""
    frame = jax.tree.map(lambda layer: layer[90:130, 150:210], jflnr.read_frame(SHIPPED_FRAME))
    random, size = np.random.default_rng(0), frame.indirect.shape[:2]
    layers = {"motion": np.zeros((*size, 2), np.float32)}
    noisy = [frame.reference * random.gamma(0.2, 5, (*size, 1)) for _ in range(10)]
    return [dataclasses.replace(frame, indirect=np.float32(n), **layers) for n in noisy]


def test_error_falls_over_time(still: list[Frame]) -> None:
    state, errors = svgf.start(still[0]), []
    for frame in still:
        state, image = svgf.step(state, frame)
        errors.append(np.mean((np.asarray(image) - frame.reference) ** 2))
    assert errors[-1] < errors[0] / 4
    np.testing.assert_allclose(np.mean(image), np.mean(frame.reference), rtol=0.15)


def test_unfiltered_it_is_a_temporal_mean(still: list[Frame]) -> None:
    """With luminance weights of no width no pixel is mixed with another."""
    state = svgf.start(still[0])
    for frame in still[:4]:
        state, image = svgf.step(state, frame, sigma_l=0.0)
    wanted = np.mean([frame.indirect for frame in still[:4]], axis=0)
    np.testing.assert_allclose(image, wanted, rtol=1e-3, atol=1e-4)


def test_motion_is_needed(still: list[Frame]) -> None:
    with pytest.raises(ValueError, match="motion"):
        svgf.step(svgf.start(still[0]), dataclasses.replace(still[0], motion=None))
