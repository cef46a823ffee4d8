"""Metrics: known values, invariants, and the noisy rows that an independent program measured."""

import dataclasses
import json
from pathlib import Path

import jax
import numpy as np
import pytest

from jflnr import metrics
from jflnr.frame import Frame, read_frame


def test_display_brings_the_mean_to_035_before_gamma() -> None:
    picture = np.random.default_rng(0).random((8, 9, 3)) * 7
    shown = metrics.display(picture / 100, metrics.exposure(picture / 100))
    assert np.isclose((shown**2.2).mean(), 0.35, rtol=1e-12)
    assert metrics.exposure(np.zeros((2, 2, 3))) == 1
    np.testing.assert_array_equal(metrics.display(np.array([-1.0, 9.0]), 1), [0, 1])


def test_perfect_image(frame: Frame) -> None:
    measured = metrics.measure(frame, frame.reference)
    assert measured["psnr"] == np.inf
    assert measured["ssim"] == pytest.approx(1)
    assert (measured["rmse"], measured["smape"], measured["mse"]) == (0, 0, 0)


def test_psnr_of_a_known_error() -> None:
    assert metrics.psnr(np.full((9, 9, 3), 0.6), np.full((9, 9, 3), 0.5)) == pytest.approx(20)


def test_closed_forms_on_radiance() -> None:
    x, y = np.full((4, 4, 3), 3.0), np.full((4, 4, 3), 1.0)
    assert metrics.smape(x, y) == pytest.approx(2 / 4)
    assert metrics.relative_mse(x, y) == pytest.approx(4 / 1.01)
    assert metrics.smape(0 * x, 0 * y) == metrics.relative_mse(0 * x, 0 * y) == 0


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_the_unit_of_light_does_not_matter(frame: Frame, scale: float) -> None:
    same = metrics.measure(frame, frame.indirect)
    fields = ("indirect", "reference", "reference_a")
    scaled = dataclasses.replace(
        frame, **{f: getattr(frame, f) * np.float32(scale) for f in fields}
    )
    other = metrics.measure(scaled, scaled.indirect)
    for name in ("psnr", "ssim", "rmse", "smape"):
        assert other[name] == pytest.approx(same[name], rel=1e-4), name


def test_unbiased_error_removes_the_noise_of_the_reference() -> None:
    rng = np.random.default_rng(0)
    truth = np.ones((300, 300, 3))
    half_a, half_b = (truth + 0.5 * rng.standard_normal(truth.shape) for _ in range(2))
    image = truth + 0.1
    assert np.mean((image - (half_a + half_b) / 2) ** 2) == pytest.approx(0.01 + 0.125, rel=0.02)
    assert metrics.unbiased_mse(image, half_a, half_b) == pytest.approx(0.01, rel=0.2)


def test_measure_uses_the_half_reference_only_if_there_is_one(frame: Frame) -> None:
    assert metrics.measure(frame, frame.indirect)["mse_unbiased"] is not None
    without = dataclasses.replace(frame, reference_a=None)
    assert metrics.measure(without, frame.indirect)["mse_unbiased"] is None


def test_flip_is_left_out_without_its_package(
    frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "flip_evaluator", None)
    assert metrics.measure(frame, frame.indirect)["flip"] is None


def test_flip_grows_with_the_error(frame: Frame) -> None:
    pytest.importorskip("flip_evaluator")
    near, far = (
        metrics.measure(frame, frame.reference * (1 + share))["flip"] for share in (0.05, 0.5)
    )
    assert near is not None and far is not None and 0 < near < far < 1


def test_ssim_is_left_out_for_tiny_images(frame: Frame) -> None:
    tiny = jax.tree.map(lambda image: image[:5, :6], frame)
    assert metrics.measure(tiny, tiny.indirect)["ssim"] is None


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pixel_that_is_not_finite_makes_all_nan(frame: Frame, value: float) -> None:
    indirect = frame.indirect.copy()
    indirect[3, 4] = value
    black = dataclasses.replace(frame, albedo=frame.albedo * (indirect == indirect.clip(0, 1e9)))
    for each in (frame, black):
        measured = metrics.measure(each, indirect)
        assert all(np.isnan(measured[n]) for n in ("psnr", "ssim", "flip", "rmse", "smape", "mse"))


def test_errors(frame: Frame) -> None:
    with pytest.raises(ValueError, match="no layer reference"):
        metrics.measure(dataclasses.replace(frame, reference=None), frame.indirect)
    with pytest.raises(ValueError, match="indirect is 39 x 24, reference is 40 x 24"):
        metrics.measure(frame, frame.indirect[:, 1:])


@pytest.mark.parametrize(
    ("name", "spp"),
    [
        ("test/bathroom2_0.exr", 1),
        ("test/sponza_1.exr", 16),
        ("val/veach-lamp_2.exr", 4),
        ("train/living-room-2_0.exr", 1),
    ],
)
def test_noisy_rows_of_the_baselines(data: Path, name: str, spp: int) -> None:
    """The baselines come from an independent numpy program; they are given to 3 and 4 digits."""
    rows = json.loads((data / "baselines.json").read_text())["frames"][name]
    frame = read_frame(data / name, spp)
    measured = metrics.measure(frame, frame.indirect)
    expected = rows[f"{spp} spp"]["noisy"]
    assert measured["psnr"] == pytest.approx(expected["psnr"], abs=6e-4)
    assert measured["ssim"] == pytest.approx(expected["ssim"], abs=6e-5)
