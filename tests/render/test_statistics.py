"""1-spp statistics against those of noise whose moments are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.rendering.statistics import covered, measure, measure_file
from jflnr.exr import write_channels


def _noise(p: float) -> np.ndarray:
    """2000 pixels of mean 1, a share `p` of them lit."""
    return np.where(np.arange(2000) < 2000 * p, 1 / p, 0.0)


@pytest.mark.parametrize("p", [0.5, 0.1, 0.01])
def test_moments_of_pixels_that_are_lit_or_not(p: float) -> None:
    """A Bernoulli variable: relative variance `(1 - p) / p`, kurtosis `1 / p (1 - p) - 6`."""
    found = measure(3 * _noise(p), np.full(2000, 3.0))
    assert found["lit"] == pytest.approx(p) and found["contrast"] == pytest.approx(0)
    assert found["variance"] == pytest.approx((1 - p) / p)
    assert found["kurtosis"] == pytest.approx(1 / (p * (1 - p)) - 6)


def test_every_1_spp_layer_of_a_frame_counts_and_no_other(tmp_path: Path) -> None:
    layers = {"indirect_1": 0.5, "indirect_1_b": 0.1, "indirect_16": 1.0, "reference": 1.0}
    channels = {
        f"{layer}.{c}": _noise(p).reshape(40, 50).astype("f4")
        for layer, p in layers.items()
        for c in "RGB"
    }
    channels["mask.Y"] = np.ones((40, 50), "f4")
    write_channels(tmp_path / "frame.exr", channels, '{"scene": "forms-1"}')
    scene, found = measure_file(tmp_path / "frame.exr")
    assert scene == "forms-1"
    assert [values["lit"] for values in found] == pytest.approx([0.5, 0.1])


def test_covered_is_the_share_within_the_range() -> None:
    assert covered([1, 5], [0.5, 1, 3, 6]) == 0.5
