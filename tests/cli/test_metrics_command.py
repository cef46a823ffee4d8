"""`jflnr metrics A [B]`: which files may stand on either side."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr, layouts, metrics
from jflnr.cli import main
from jflnr.frame import Frame
from tests.layouts.blender_passes import passes


def measured(capsys: pytest.CaptureFixture[str], *argv: object) -> dict:
    assert main(["metrics", *map(str, argv), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def write(path: Path, layer: str, image: np.ndarray) -> Path:
    exr.write_channels(path, {f"{layer}{c}": image[..., i] for i, c in enumerate("RGB")})
    return path


def test_a_frame_against_its_own_reference(
    frame: Frame, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert measured(capsys, frame_file) == metrics.measure(frame, frame.indirect)


def test_denoised_light_against_a_frame(
    tmp_path: Path, frame: Frame, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    light = np.asarray(frame.reference) * np.float32(1.1)
    a = write(tmp_path / "a.exr", "indirect.", light)
    assert measured(capsys, a, frame_file) == metrics.measure(frame, light)


def test_plain_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    x = np.random.default_rng(0).random((9, 8, 3)).astype(np.float32)
    a, b = write(tmp_path / "a.exr", "", 0.5 * x), write(tmp_path / "b.exr", "", x)
    values = measured(capsys, a, b)
    assert values["smape"] == pytest.approx(1 / 3, rel=1e-6)
    assert "mse_unbiased" not in values


def test_a_reference_from_elsewhere(
    tmp_path: Path, frame: Frame, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a frame light, of another program's picture another picture."""
    other = write(tmp_path / "other.exr", "", np.asarray(frame.indirect) * np.float32(1.1))
    values = measured(capsys, frame_file, "--map", f"reference={other}")
    elsewhere = dataclasses.replace(frame, reference=1.1 * frame.indirect, reference_a=None)
    right = metrics.measure(elsewhere, frame.indirect) | {"mse_unbiased": values["mse_unbiased"]}
    assert values == pytest.approx(right, rel=1e-4)
    whole = tmp_path / "whole.exr"
    exr.write_channels(whole, passes(frame))
    picture, clean = layouts.picture(passes(frame), ""), exr.read_channels(other)
    right = metrics.compare(picture, np.stack([clean[c] for c in "RGB"], -1))
    assert measured(capsys, whole, "--map", f"reference={other}") == pytest.approx(right, rel=1e-4)


def test_what_is_mapped_counts_for_pictures_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    x = np.random.default_rng(0).random((9, 8, 3)).astype(np.float32)
    channels = {f"{layer}{c}": x[..., i] for layer in ("", "clean.") for i, c in enumerate("RGB")}
    exr.write_channels(tmp_path / "b.exr", channels | {"R": 1 - x[..., 0]})
    a, b = write(tmp_path / "a.exr", "", x), tmp_path / "b.exr"
    assert measured(capsys, a, b)["mse"] > 0
    assert measured(capsys, a, b, "--map", "beauty=clean")["mse"] == 0
    for line in (
        ["metrics", str(a), str(b), "--map", "nothing=clean"],
        ["metrics", str(a), str(b), "--map", "beauty=nothing"],
        ["report", str(a), "-o", str(tmp_path / "page"), "--map", "albedo=R"],
    ):
        assert main(line) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_an_infinite_psnr_is_null_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a = write(tmp_path / "a.exr", "", np.ones((9, 8, 3), np.float32))
    assert measured(capsys, a)["psnr"] is None


def test_table(frame_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["metrics", str(frame_file)]) == 0
    heading, values = capsys.readouterr().out.splitlines()
    assert heading.split()[:2] == ["PSNR", "dB"]
    assert values.startswith("frame.exr")


def test_errors(tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = write(tmp_path / "small.exr", "indirect.", np.ones((3, 4, 3), np.float32))
    for argv, message in [
        ((small, frame_file), "indirect is 4 x 3, reference is 40 x 24"),
        ((small, small), "there is no picture in it; the file holds indirect"),
        ((frame_file, frame_file, "--spp", "4"), "there is indirect light for spp 1"),
        ((tmp_path / "gone.exr", frame_file), "there is no such file"),
    ]:
        assert main(["metrics", *map(str, argv)]) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1
