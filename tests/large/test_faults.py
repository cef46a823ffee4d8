"""Files of all kinds, whole and in pieces: one picture, one header, one list of warnings."""

import json
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr
from jflnr.cli import main
from jflnr.frame import Frame, read_header
from jflnr.large import memory
from tests.layouts.blender_passes import passes
from tests.layouts.test_faults import picture_of
from tests.layouts.test_pbrt import gbuffer
from tests.layouts.test_rows import mitsuba

pytest.importorskip("OpenImageIO")


def with_alpha(frame: Frame) -> dict[str, np.ndarray]:
    return picture_of(frame) | {"A": np.ones(frame.depth.shape[:2], np.float32)}


def with_nan(frame: Frame) -> dict[str, np.ndarray]:
    channels = with_alpha(frame)
    channels["albedo.R"][20, 3:9] = np.nan
    return channels


def behind(frame: Frame) -> dict[str, np.ndarray]:
    return picture_of(frame) | {"depth.Z": -np.asarray(frame.depth)[..., 0]}


def nothing(frame: Frame) -> dict[str, np.ndarray]:
    return picture_of(frame) | {"depth.Z": 0 * np.asarray(frame.depth)[..., 0]}


KINDS = [passes, mitsuba, gbuffer, picture_of, with_alpha, with_nan, behind]


@pytest.mark.parametrize("kind", [*KINDS, nothing], ids=lambda kind: kind.__name__)
def test_pieces_are_the_whole(
    tmp_path: Path,
    frame: Frame,
    kind: object,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    path, records, outputs = tmp_path / "a.exr", [], []
    others = {"artist": "é", "gain": 2.5, "matrix": np.eye(3, dtype=np.float32)}
    exr.write_channels(path, kind(frame), '{"scene": "x"}', None, others)  # type: ignore[operator]
    for tile in (None, 16):
        monkeypatch.setattr(memory, "tile_for", lambda *_, tile=tile: tile)
        outputs.append(tmp_path / f"{tile}.exr")
        command = ["denoise", str(path), "-o", str(outputs[-1]), "--json", "--backend", "jax"]
        assert main(command) == 0
        records += json.loads(capsys.readouterr().out)
    whole, pieces = records
    assert pieces["warnings"] == whole["warnings"]
    assert pieces["layout"] == whole["layout"] and pieces["guides"] == whole["guides"]
    wanted, found = map(exr.read_channels, outputs)
    assert found.keys() == wanted.keys()
    for name, pixels in wanted.items():
        # Fits of 13 guides to 40 x 24 pixels make more of rounding, in a single piece too.
        most = 2e-3 if whole["method"] == "picture" else 1e-4
        np.testing.assert_allclose(found[name], pixels, rtol=most, atol=1e-5)
    first, second = (exr.read_attributes(output) for output in outputs)
    assert read_header(outputs[0]) == read_header(outputs[1])
    assert first._replace(others={}) == second._replace(others={})
    assert str(first.others) == str(second.others) and "artist" in second.others
