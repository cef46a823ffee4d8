"""Fitting on a made-up frame: what it learns lowers the error that it says it does."""

import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr.fitting import fit
from jflnr.frame import Frame
from jflnr.metrics import exposure
from jflnr.network.loss import shown_error
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.flr import FLR

HEIGHT, WIDTH = 48, 64
X = np.mgrid[:HEIGHT, :WIDTH][1].astype(np.float32) / WIDTH
LEFT = X < 0.5


def image(*planes: np.ndarray) -> np.ndarray:
    return np.stack(planes, axis=-1).astype(np.float32)


@pytest.fixture
def frame() -> Frame:
    """Two walls under smooth light, of which one pixel in ten sees ten times as much."""
    light = np.where(LEFT, 1 + X, 3 - 2 * X)[..., None] * np.ones(3)
    hit = np.random.default_rng(0).random((HEIGHT, WIDTH, 1)) < 0.1
    return Frame(
        indirect=(10 * hit * light).astype(np.float32),
        normal=image(LEFT, ~LEFT, 0 * X),
        depth=image(1 + X),
        ao=image(0.5 + 0.1 * X),
        albedo=np.full((HEIGHT, WIDTH, 3), 0.5, np.float32),
        reference=light.astype(np.float32),
    )


def shown(frame: Frame, light: np.ndarray) -> float:
    scale = exposure(frame.albedo * frame.reference)
    pictures = (jnp.asarray(frame.albedo * some * scale) for some in (light, frame.reference))
    return float(shown_error(*pictures))


def test_adaptive_parameters_lower_the_error_of_what_is_shown(frame: Frame) -> None:
    start = AdaptiveFLR(sigma=0.7)
    found = fit([frame], "flr-adaptive", initial=start, steps=4)
    assert found.after < found.before - 0.1
    for parameters, error in ((start, found.before), (found.parameters, found.after)):
        light = np.asarray(jflnr.denoise(frame, "flr-adaptive", parameters=parameters))
        assert shown(frame, light) == pytest.approx(error, abs=1e-3)


def test_parameters_of_flr_lower_smape(frame: Frame) -> None:
    found = fit([frame], initial=FLR(3, 1e-4, 1e-4), steps=4)
    assert found.after < 0.9 * found.before and float(found.parameters.sigma) > 4


def test_what_cannot_be_fitted_is_refused(frame: Frame) -> None:
    with pytest.raises(ValueError, match="frames is empty"):
        fit([])
    with pytest.raises(ValueError, match="method must be one of flr, flr-adaptive"):
        fit([frame], "auto")
