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


KINDS = [passes, mitsuba, gbuffer, picture_of, with_alpha, with_nan, behind, nothing]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize(
    ("method", "backend"), [("picture", "jax"), ("flr", "opencl")], indirect=["backend"]
)
def test_pieces_are_the_whole(
    tmp_path: Path,
    frame: Frame,
    kind: object,
    method: str,
    backend: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    path, records, outputs = tmp_path / "a.exr", [], []
    others = {"artist": "é", "gain": 2.5, "matrix": np.eye(3, dtype=np.float32)}
    exr.write_channels(path, kind(frame), '{"scene": "x"}', None, others)  # type: ignore[operator]
    for tile, held in ((None, True), (16, True), (16, False)):
        monkeypatch.setattr(memory, "tile_for", lambda *_, tile=tile: tile)
        monkeypatch.setattr(memory, "holds", lambda *_, held=held: held)
        outputs.append(tmp_path / f"{tile} {held}.exr")
        chosen = ["--method", method, "--backend", backend]
        assert main(["denoise", str(path), "-o", str(outputs[-1]), "--json", *chosen]) == 0
        records += json.loads(capsys.readouterr().out)
    whole, *others = records
    right, wanted = exr.read_attributes(outputs[0]), exr.read_channels(outputs[0])
    for record, output in zip(others, outputs[1:], strict=True):
        assert all(record[name] == whole[name] for name in ("warnings", "layout", "guides"))
        found, attributes = exr.read_channels(output), exr.read_attributes(output)
        assert found.keys() == wanted.keys()
        for name, pixels in wanted.items():
            # Fits of 13 guides to 40 x 24 pixels make more of rounding, in a single piece too.
            most = 2e-3 if method == "picture" else 1e-4
            np.testing.assert_allclose(found[name], pixels, rtol=most, atol=1e-5)
        assert read_header(output) == read_header(outputs[0])
        assert attributes._replace(others={}) == right._replace(others={})
        assert str(attributes.others) == str(right.others) and "artist" in right.others
