"""Metrics over time: sequences whose flicker, lag and recovery are known in closed form."""

import dataclasses

import numpy as np
import pytest

from experiments import temporal_metrics
from jflnr.frame import Frame
from jflnr.metrics import display, exposure

HEIGHT, WIDTH, LENGTH = 24, 40, 20


def shot(shifts: list[int]) -> list[Frame]:
    """A textured wall that moves `shift` pixels to the left from the frame before."""
    frames = []
    for start in np.cumsum(shifts):
        y, x = np.mgrid[:HEIGHT, start : start + WIDTH].astype(np.float32)[..., None]
        flat = np.zeros_like(x)
        light = 1 + np.concatenate([x, y, x + y], -1) / 40
        frames.append(
            Frame(
                indirect=light,
                albedo=np.concatenate([0.4 + 0.3 * np.sin(x), 0.5 + flat, 0.3 + flat], -1),
                normal=np.concatenate([flat, flat, 1 + flat], -1),
                depth=2 + flat,
                position=np.concatenate([x / 20, y / 20, 2 + flat], -1),
                mask=1 + flat,
                reference=light,
                motion=np.concatenate([flat + shifts[len(frames)], flat], -1),
            )
        )
    return frames


def changing(values: np.ndarray) -> np.ndarray:
    """A light whose brightness over time is given, `(T, H, W, 3)`."""
    x = np.linspace(0.5, 1.5, WIDTH)[:, None] * np.ones(3)
    return values[:, None, None, None] * np.broadcast_to(x, (HEIGHT, WIDTH, 3))


def test_light_that_goes_with_its_surface_does_not_flicker() -> None:
    frames = shot([0, 3, 2])
    rows = temporal_metrics.measure_sequence(frames, [frame.reference for frame in frames])
    assert "warped" not in rows[0] and rows[1]["psnr"] == np.inf
    assert max(row["warped"] for row in rows[1:]) < 1e-6 < 1e-2 < rows[1]["temporal"]


def test_flicker_is_the_change_of_displayed_luminance() -> None:
    frames = shot([0, 0])
    lights = [np.full((HEIGHT, WIDTH, 3), value, np.float32) for value in (1.0, 1.1)]
    scale = temporal_metrics.sequence_exposure(frames)
    assert scale == pytest.approx(exposure(frames[0].albedo * frames[0].reference))
    pictures = [display(frames[0].albedo * light, scale) for light in lights]
    expected = np.abs((pictures[1] - pictures[0]) @ [0.2126, 0.7152, 0.0722]).mean()
    row = temporal_metrics.measure_sequence(frames, lights)[1]
    assert row["temporal"] == row["warped"] == pytest.approx(expected, rel=1e-6)


def test_what_was_not_in_view_does_not_count() -> None:
    frames = shot([0, 4])
    wrong = frames[1].reference.copy()
    wrong[:, -4:] = 9  # came into view at the right border
    row = temporal_metrics.measure_sequence(frames, [frames[0].reference, wrong])[1]
    assert row["warped"] < 1e-6 and row["psnr"] < 30


def test_the_noise_of_the_reference_can_be_left_out() -> None:
    rng = np.random.default_rng(3)
    frame, truth = shot([0])[0], shot([0])[0].reference
    half_a, half_b = (truth * (1 + 0.1 * rng.standard_normal(truth.shape)) for _ in range(2))
    noisy = dataclasses.replace(frame, reference=(half_a + half_b) / 2, reference_a=half_a)
    light = truth * (1 + 0.05 * rng.standard_normal(truth.shape))
    row = temporal_metrics.measure_sequence([noisy], [light])[0]
    known = temporal_metrics.measure_sequence([frame], [light])[0]
    assert known["psnr_unbiased"] is None
    assert row["psnr_unbiased"] == pytest.approx(known["psnr"], abs=0.3)
    assert row["psnr"] < known["psnr"] - 1


def test_only_what_does_not_truly_change_is_a_false_change() -> None:
    """Of noisy references, one of which gets brighter."""
    rng = np.random.default_rng(4)
    frames = []
    for frame, light in zip(shot([0, 0]), (1.0, 1.5), strict=True):
        truth = np.full_like(frame.reference, light)
        half_a, half_b = (truth * (1 + 0.1 * rng.standard_normal(truth.shape)) for _ in range(2))
        half = {"reference": (half_a + half_b) / 2, "reference_a": half_a}
        frames.append(dataclasses.replace(frame, **half))
    bright, dark = np.full_like(half_a, 1.5), np.full_like(half_a, 1.0)
    scale = temporal_metrics.sequence_exposure(frames)
    pair = frames[0], frames[1]
    true = temporal_metrics.warped_error(pair, (dark, bright), scale)
    follows, lags = (
        temporal_metrics.false_change(pair, lights, scale)
        for lights in ((dark, bright), (dark, dark))
    )
    assert lags == pytest.approx(true**2, rel=0.1)
    assert abs(follows) < 0.02 * lags


@pytest.mark.parametrize("delay", [0, 3, 2.5])
def test_lag_of_a_delayed_sequence(delay: float) -> None:
    time = np.arange(LENGTH)
    moving = lambda t: (
        changing(1 + np.sin(2 * np.pi * t / 20)) + changing((t / 9) ** 2)[..., ::-1, :]
    )
    assert temporal_metrics.lag(moving(time - delay), moving(time)) == pytest.approx(delay, abs=0.1)


def test_lag_of_an_exponential_average_is_that_of_its_weights() -> None:
    """Weights a (1 - a)^k have the mean delay (1 - a) / a: 4 frames for a = 0.2."""
    references = changing(np.arange(200.0))
    mean = np.zeros_like(references[0])
    lights = [mean := 0.8 * mean + 0.2 * image for image in references]
    assert temporal_metrics.lag(np.stack(lights), references) == pytest.approx(4, abs=0.1)


def test_response_to_a_switch() -> None:
    before, after = changing(np.array([1.0, 3.0]))
    share = np.array([0, 0, 0.2, 0.36, 1])
    lights = before + share[:, None, None, None] * (after - before)
    np.testing.assert_allclose(temporal_metrics.response(lights, before, after), share, atol=1e-12)
    with pytest.raises(ValueError, match="the same"):
        temporal_metrics.response(lights, before, before)


def test_ages_and_what_has_come_into_view() -> None:
    frames = shot([0, 0, 4, 0, 0])
    ages = temporal_metrics.ages(frames)
    assert np.isinf(ages[:, :, :-4]).all() and np.isinf(ages[:2]).all()
    assert [set(age[:, -4:].ravel()) for age in ages[2:]] == [{0}, {1}, {2}]
    lights = [frame.reference.copy() for frame in frames]
    lights[2][:, -4:] *= 1.5
    lights[3][:, -4:] *= 1.1
    found = temporal_metrics.by_region(frames, lights, still_camera=False)
    assert found["0"] < found["1 to 3"] and found["4 to 7"] is None
    assert found["moving"] is found["always"] is None


def test_what_moves_is_measured_alone() -> None:
    """In the third frame all moves, in the others nothing."""
    frames = shot([0, 0, 4, 0, 0])
    scale = exposure(np.stack([frame.albedo * frame.reference for frame in frames]))
    lights = [(1.2 if i == 2 else 3.0) * frame.reference for i, frame in enumerate(frames)]
    shown, true = (display(frames[2].albedo * x, scale) for x in (lights[2], frames[2].reference))
    wanted = -10 * np.log10(np.mean((shown - true) ** 2))
    found = temporal_metrics.by_region(frames, lights, still_camera=True)
    assert found["moving"] == pytest.approx(wanted, abs=1e-3) and found["0"] is None
    assert temporal_metrics.by_region(frames[:2], lights[:2], True)["moving"] is None


def test_noise_of_the_references_does_not_count() -> None:
    frames, rng = shot([0, 0]), np.random.default_rng(0)
    lights = [1.05 * frame.reference for frame in frames]
    exact = temporal_metrics.by_region(frames, lights, True)["always"]
    noise = [0.2 * rng.standard_normal((2, *light.shape)) for light in lights]
    noisy = [
        dataclasses.replace(f, reference=f.reference + n.mean(0), reference_a=f.reference + n[0])
        for f, n in zip(frames, noise, strict=True)
    ]
    found = temporal_metrics.by_region(noisy, lights, True)["always"]
    assert found == pytest.approx(exact, abs=1.5)
    biased = [dataclasses.replace(frame, reference_a=None) for frame in noisy]
    assert temporal_metrics.by_region(biased, lights, True)["always"] < exact - 5


def test_wrong_sequences_are_refused() -> None:
    frames = shot([0, 0])
    light = frames[0].reference
    with pytest.raises(ValueError, match="do not match"):
        temporal_metrics.measure_sequence(frames, [light])
    still = [dataclasses.replace(frame, motion=None) for frame in frames]
    with pytest.raises(ValueError, match="no layer motion"):
        temporal_metrics.measure_sequence(still, [light, light])
    unknown = [dataclasses.replace(frame, reference=None) for frame in frames]
    with pytest.raises(ValueError, match="layer reference"):
        temporal_metrics.measure_sequence(unknown, [light, light])
