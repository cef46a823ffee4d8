"""`jflnr denoise --method auto --explain`: what it prints, and the map it writes.

Denoising and planning are stood in for; what they do is tested in tests/auto.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jflnr import denoising
from jflnr.auto import method
from jflnr.auto.plan import Plan
from jflnr.cli import main
from jflnr.frame import Frame


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch) -> Plan:
    """A plan for the frame of 40 x 24: its left half needs no guide, its right half all."""
    order = np.zeros((3, 5))
    order[:, 3:] = 3
    decibels = {"blocks-8": 25.0, "blocks-4": 25.5}
    cost = {"blocks-8": 1.0, "blocks-4": 1.5}
    plan = Plan("blocks-8", ("normal", "ao"), decibels, cost, 12.0, order, 8, 3)
    monkeypatch.setattr(method, "plan_of", lambda *arguments: plan)
    half = lambda _, frame: 0.5 * frame.indirect
    monkeypatch.setattr(denoising.Denoiser, "__call__", half)
    return plan


def test_tells_the_plan_and_writes_its_map(
    planned: Plan, tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    assert main(["denoise", str(frame_file), "-o", str(out), "--method", "auto", "--explain"]) == 0
    told = capsys.readouterr()
    text = told.out + told.err
    assert "blocks-8 with normal, ao, 25.0 dB predicted, 12 ms" in text
    assert "blocks-4 +0.5 dB for x 1.5" in text
    assert "0: 60%, 1: 0%, 2: 0%, 3: 40%" in text
    picture = np.asarray(Image.open(tmp_path / "out.plan.png")).astype(int)
    assert picture.shape == (24, 40, 3)
    left, right = picture[:, :24], picture[:, 24:]
    assert (left == left[0, 0]).all()
    assert (right == right[0, 0]).all()
    assert right[0, 0].sum() > left[0, 0].sum() + 300


def test_needs_method_auto(
    frame: Frame, frame_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    assert main(["denoise", str(frame_file), "-o", str(out), "--explain"]) == 2
    assert "--method auto" in capsys.readouterr().err
    assert not out.exists()
