"""What is measured of a result, and the bar that ours has to clear."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.stability.cases import Case

ERROR_BAR, OVERSHOOT_BAR = 10, 2
TINY = float(np.finfo(np.float32).tiny)


def measure(case: Case, result: np.ndarray, truth: np.ndarray, exact: np.ndarray) -> dict[str, Any]:
    """Figures of one cell of the atlas.

    result: `(H, W, 2)`, what the method makes of `case.target`. truth: the exact answer to the
    problem it solves. exact: that to ours (Eq. 18-23), the same for all methods.

    not_finite: usable pixels, with noise or without. error: RMS from the noise-free light, over
    that of `exact`. rounding: largest difference from `truth`, overshoot: by how much the result
    leaves the range of the input, bias: RMS error of the mean over all noise; these three relative
    to the input's range. bleeding: mean bias within 3 pixels of the step in the light, relative to
    the light's range, or None.
    """
    target = case.target.astype(np.float64)[case.usable]
    noisy, light = target.T
    span = max(float(np.ptp(noisy)), TINY)
    found = np.where(np.isfinite(result), result.astype(np.float64), np.nan)[case.usable]
    by_noise, by_light = found.T
    leaves = np.maximum(np.max(by_noise) - noisy.max(), noisy.min() - np.min(by_noise))
    # What is lost below the smallest normal number, or the millionth part of the input, is nothing.
    floor = max(1e-6 * span, TINY)
    figures = {
        "error": (_rms(by_noise - light) + floor) / (_rms(_noisy(exact, case) - light) + floor),
        "rounding": np.max(np.abs(by_noise - _noisy(truth, case))) / span,
        "overshoot": max(leaves, 0) / span,
        "bias": _rms(by_light - light) / span,
    }
    return {
        "not_finite": int(np.sum(np.isnan(found).any(axis=1))),
        **{name: _number(value) for name, value in figures.items()},
        "bleeding": None if case.edge is None else _bleeding(case, result),
    }


def _bleeding(case: Case, result: np.ndarray) -> float | None:
    light = case.target[..., 1].astype(np.float64)
    near = case.usable & case.edge
    with np.errstate(all="ignore"):
        off = np.abs(result[..., 1].astype(np.float64) - light)[near]
        return _number(np.mean(off) / max(np.ptp(light[case.usable]), TINY))


def _noisy(image: np.ndarray, case: Case) -> np.ndarray:
    return image[..., 0].astype(np.float64)[case.usable]


def _rms(difference: np.ndarray) -> float:
    largest = np.max(np.abs(difference), initial=0)
    # Scaled, so that the squares of values near float64's limits stay numbers.
    return float(largest and largest * np.sqrt(np.mean((difference / largest) ** 2)))


def _number(value: float) -> float | None:
    """JSON has no NaN and no infinity."""
    return float(value) if np.isfinite(value) else None


def passes(figures: dict[str, Any]) -> bool:
    """The bar: all finite, overshoot at most twice the range, error within 10 of the exact one."""
    error, overshoot = figures["error"], figures["overshoot"]
    if figures["not_finite"] or error is None or overshoot is None:
        return False
    return error <= ERROR_BAR and overshoot <= OVERSHOOT_BAR
