"""`jflnr fit`: what it reads, prints and writes. The stand-in keeps these tests quick."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import jflnr
from jflnr import exr, fitting
from jflnr.cli import main
from jflnr.frame import Frame, read_frame, write_frame
from jflnr.parameters import load_parameters
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.flr import FLR


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    calls: list[dict] = []

    def fit(
        frames: Sequence[Frame],
        method: str,
        *,
        progress: Callable[[int, float], None],
        **settings: object,
    ) -> fitting.Fit:
        calls.append({"frames": len(frames), "method": method, **settings})
        progress(1, 0.25)
        numbers = FLR(20, 1e-3, 1e-4)
        if method == "flr-adaptive":
            return fitting.Fit(AdaptiveFLR(sigma=1.5), -20, -21, 1)
        return fitting.Fit(numbers, 0.5, 0.25, 1)

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
    assert stand_in == [
        {"frames": 2, "method": "flr", "guides": ("normal",), "block": 4, "steps": 3}
    ]
    parameters, about = load_parameters(out)
    assert float(parameters.sigma) == pytest.approx(20)
    assert (about["guides"], about["block"], about["spp"]) == (["normal"], 4, [1])


def test_parameters_are_for_the_method_they_were_fitted_for(
    tmp_path: Path,
    frame_file: Path,
    stand_in: list[dict],
    capsys: pytest.CaptureFixture[str],
) -> None:
    params, out = tmp_path / "p.json", tmp_path / "out"
    argv = ["fit", str(frame_file), "-o", str(params), "--method", "flr-adaptive"]
    assert main(argv) == 0
    assert "sigma 1.5, eps 0.0001" in capsys.readouterr().out
    found, about = load_parameters(params)
    assert isinstance(found, AdaptiveFLR) and "block" not in about
    np.testing.assert_allclose(found, AdaptiveFLR(sigma=1.5), rtol=1e-6)
    denoise = ["denoise", str(frame_file), "-o", str(out), "--params", str(params)]
    assert main([*denoise, "--method", "flr-adaptive", "--quiet"]) == 0
    light = exr.read_channels(out / frame_file.name)["indirect.G"]
    wanted = jflnr.denoise(read_frame(frame_file), "flr-adaptive", parameters=found)
    np.testing.assert_allclose(light, wanted[..., 1], rtol=2e-3, atol=1e-4)
    assert main(denoise) == 2
    assert "holds parameters of method flr-adaptive" in capsys.readouterr().err


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
