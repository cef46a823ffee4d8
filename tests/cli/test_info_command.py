"""`jflnr info`: what it says of good, partial and bad files."""

import json
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr
from jflnr.cli import main
from jflnr.methods import BACKENDS


def info(path: Path, capsys: pytest.CaptureFixture[str]) -> dict:
    assert main(["info", str(path), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_frame(frame_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = info(frame_file, capsys)
    assert (facts["width"], facts["height"]) == (40, 24)
    layers = {layer["layer"]: layer for layer in facts["layers"]}
    assert layers["normal"] == {
        "layer": "normal",
        "channels": "X Y Z",
        "type": "half",
        "min": 0,
        "max": 1,
        "not_finite_pixels": 0,
    }
    assert layers["albedo"]["channels"] == "R G B"
    assert layers["depth"]["type"] == "float"
    assert facts["denoiser"]["spp"] == [1]
    assert facts["denoiser"]["backend"] in BACKENDS
    assert facts["denoiser"]["guides"] == ["normal", "depth", "ao"]
    assert facts["denoiser"]["reference"] is True


def test_pixels_that_are_not_finite_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = np.ones((4, 5), np.float32)
    image[1, 2] = np.nan
    other = image.copy()
    other[3, 3] = np.inf
    exr.write_channels(tmp_path / "a.exr", {"light.R": image, "light.G": other})
    (layer,) = info(tmp_path / "a.exr", capsys)["layers"]
    assert (layer["min"], layer["max"], layer["not_finite_pixels"]) == (1, 1, 2)


def test_a_layer_without_a_finite_value(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exr.write_channels(tmp_path / "a.exr", {"R": np.full((4, 5), np.nan, np.float32)})
    assert info(tmp_path / "a.exr", capsys)["layers"][0]["min"] is None
    assert main(["info", str(tmp_path / "a.exr")]) == 0


def test_a_file_that_cannot_be_denoised_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    window = exr.Window((3, 4), (0, 0, 99, 99))
    exr.write_channels(tmp_path / "a.exr", dict.fromkeys("RGB", np.ones((4, 5), "f")), "", window)
    assert main(["info", str(tmp_path / "a.exr")]) == 0
    text = capsys.readouterr().out
    assert "5 x 4 pixels from (3, 4), NO compression, 1 part" in text
    assert "layer indirect_1 is missing; the file holds plain RGB; layers that go by" in text


def test_a_real_frame(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(data / "test" / "bathroom2_0.exr")]) == 0
    text = capsys.readouterr().out
    assert "640 x 360 pixels" in text
    assert "indirect_1 (--spp 1), indirect_4 (--spp 4), indirect_16 (--spp 16)" in text
    assert "absent       motion" in text
