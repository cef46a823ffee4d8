"""`jflnr denoise --method auto --explain`: what it prints, and the map it writes.

Denoising is stood in for; what it does is tested in tests/regression.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jflnr import denoising
from jflnr.cli import main
from jflnr.frame import Frame
from jflnr.regression import auto


def test_tells_what_was_refined_and_writes_its_map(
    tmp_path: Path,
    frame_file: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(auto, "signal_in_tiles", lambda *_: (np.array([[0.1, 0.9]]), 32))
    half = lambda _, frame: 0.5 * frame.indirect
    monkeypatch.setattr(denoising.Denoiser, "__call__", half)
    out = tmp_path / "out.exr"
    assert main(["denoise", str(frame_file), "-o", str(out), "--method", "auto", "--explain"]) == 0
    told = capsys.readouterr()
    assert "refined: 20% of the frame, in tiles of 32 pixels" in told.out + told.err
    picture = np.asarray(Image.open(tmp_path / "out.plan.png")).astype(int)
    assert picture.shape == (24, 40, 3)
    left, right = picture[:, :32], picture[:, 32:]
    assert (left == left[0, 0]).all() and (right == right[0, 0]).all()
    assert right[0, 0].sum() > left[0, 0].sum() + 300


def test_needs_method_auto(
    frame: Frame, frame_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    assert main(["denoise", str(frame_file), "-o", str(out), "--explain"]) == 2
    assert "--method auto" in capsys.readouterr().err
    assert not out.exists()
