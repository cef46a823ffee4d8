"""`jflnr fit`: what it reads, prints and writes. The stand-in keeps these tests quick."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from jflnr import fitting
from jflnr.cli import main
from jflnr.flr.parameters import Parameters, load_parameters
from jflnr.frame import Frame, write_frame


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    calls: list[dict] = []

    def fit(
        frames: Sequence[Frame], *, progress: Callable[[int, float], None], **settings: object
    ) -> fitting.Fit:
        calls.append({"frames": len(frames), **settings})
        progress(1, 0.25)
        return fitting.Fit(Parameters.of(20, 1e-3, 1e-4), 0.5, 0.25, 1)

    monkeypatch.setattr(fitting, "fit", fit)
    return calls


def test_result_is_printed_and_read_by_denoise(
    tmp_path: Path,
    frame_file: Path,
    stand_in: list[dict],
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "p.json"
    argv = ["fit", str(frame_file), str(frame_file), "-o", str(out), "--steps", "3"]
    assert main([*argv, "--guides", "normal", "--block", "4"]) == 0
    text = capsys.readouterr().out
    assert "step 1: SMAPE 0.25" in text and "SMAPE 0.50000 before, 0.25000 after, steps: 1" in text
    assert stand_in == [{"frames": 2, "guides": ("normal",), "block": 4, "steps": 3}]
    parameters, about = load_parameters(out)
    assert float(parameters.sigma) == pytest.approx(20)
    assert (about["guides"], about["block"], about["spp"]) == (["normal"], 4, 1)


def test_output_is_kept_unless_overwritten(
    tmp_path: Path, frame_file: Path, stand_in: list[dict]
) -> None:
    out = tmp_path / "p.json"
    out.write_text("precious")
    assert main(["fit", str(frame_file), "-o", str(out)]) == 0
    assert out.read_text() == "precious" and not stand_in
    assert main(["fit", str(frame_file), "-o", str(out), "--overwrite"]) == 0
    assert json.loads(out.read_text())["format"] == "jflnr-parameters"


def test_a_frame_without_reference_is_named(
    tmp_path: Path, frame: Frame, stand_in: list[dict], capsys: pytest.CaptureFixture[str]
) -> None:
    write_frame(tmp_path / "a.exr", dataclasses.replace(frame, reference=None))
    assert main(["fit", str(tmp_path / "a.exr"), "-o", str(tmp_path / "p.json")]) == 2
    assert "a.exr: fitting needs a layer reference" in capsys.readouterr().err
    assert not stand_in and not (tmp_path / "p.json").exists()
