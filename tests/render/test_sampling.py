"""The (0,2)-sequences: every elementary interval holds one point; streams are unrelated."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from experiments.rendering.sampling import Independent, Stratified, sobol_2d, stream_seed


@pytest.mark.parametrize("seed", [0, 1, 12345, 0xFFFFFFFF])
@pytest.mark.parametrize("bits", [4, 6, 8])
def test_every_elementary_interval_holds_one_point(bits: int, seed: int) -> None:
    points = np.array(sobol_2d(dr.arange(mi.UInt32, 1 << bits), mi.UInt32(seed))).T
    assert points.min() >= 0 and points.max() < 1
    for wide in range(bits + 1):
        cells = np.array([1 << wide, 1 << (bits - wide)])
        x, y = (points * cells).astype(int).T
        assert np.bincount(x * cells[1] + y, minlength=1 << bits).max() == 1


def test_lanes_and_dimensions_are_unrelated() -> None:
    lane = dr.arange(mi.UInt32, 1 << 14)
    points = Stratified(lane, mi.UInt32(3), mi.UInt32(0))
    columns = np.concatenate([np.array(points.next_2d()) for _ in range(3)])
    correlation = np.corrcoef(columns) - np.eye(6)
    assert np.abs(correlation).max() < 5 / np.sqrt(1 << 14)
    assert np.abs(columns.mean(1) - 0.5).max() < 5 * np.sqrt(1 / 12 / (1 << 14))


def test_independent_streams_differ_with_their_seed() -> None:
    lane = dr.arange(mi.UInt32, 1 << 12)
    a, b = (
        np.array(Independent(Independent.start(lane, mi.UInt32(s))).next_2d())
        for s in (stream_seed(0, "indirect_1"), stream_seed(0, "reference"))
    )
    assert abs(np.corrcoef(a[0], b[0])[0, 1]) < 5 / np.sqrt(1 << 12)
