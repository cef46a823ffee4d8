"""Other programs' files, a few rows at a time: what the whole file would give."""

from pathlib import Path

import numpy as np
import pytest

from jflnr import exr
from jflnr.frame import Frame, read_frame
from tests.layouts.blender_passes import passes
from tests.layouts.test_pbrt import gbuffer

pytest.importorskip("OpenImageIO")
from jflnr.large.scanlines import Scanlines

LAYERS = ("indirect", "normal", "depth", "mask")


def mitsuba(frame: Frame) -> dict[str, np.ndarray]:
    picture = frame.albedo * frame.indirect + frame.emission
    layers = {"": ("RGB", picture), "albedo": ("RGB", frame.albedo), "dd.y": ("T", frame.depth)}
    layers |= {"emission": ("RGB", frame.emission), "nn": ("XYZ", frame.normal)}
    return {
        f"{layer}.{c}" if layer else c: image[..., i].astype(np.float32)
        for layer, (components, image) in layers.items()
        for i, c in enumerate(components)
    }


@pytest.mark.parametrize("program", [passes, mitsuba, gbuffer])
def test_rows_are_those_of_the_whole(tmp_path: Path, frame: Frame, program: object) -> None:
    exr.write_channels(tmp_path / "a.exr", program(frame))  # type: ignore[operator]
    whole = read_frame(tmp_path / "a.exr")
    part = Scanlines(tmp_path / "a.exr", None, {}).rows(LAYERS).read(3, 20)
    for layer in LAYERS:
        np.testing.assert_array_equal(getattr(part, layer), getattr(whole, layer)[3:20])


def test_points_that_may_be_in_world_coordinates_are_refused(tmp_path: Path, frame: Frame) -> None:
    exr.write_channels(tmp_path / "a.exr", gbuffer(frame, world=True))
    with pytest.raises(ValueError, match="only the whole file can explain"):
        Scanlines(tmp_path / "a.exr", None, {}).rows(LAYERS).read(3, 20)
