"""Files in strips: what is read, denoised and written is what the whole file would give."""

import json
import os

import numpy as np
import pytest

import jflnr
from jflnr import exr
from jflnr.cli import main, parser
from jflnr.cli.jobs import Job
from jflnr.cli.settings import settings_of
from jflnr.methods import method_of

pytest.importorskip("OpenImageIO")
from jflnr.cli.strips import denoise_in_strips
from jflnr.large.memory import tile_for
from jflnr.large.scanlines import Scanlines


@pytest.mark.parametrize("start, stop", [(0, 5), (7, 24), (23, 24)])
def test_rows_are_those_of_the_frame(frame_file, start, stop):
    whole = jflnr.read_frame(frame_file)
    other = frame_file.with_name(os.fsdecode(b"caf\xe9.exr"))  # not UTF-8
    rows = Scanlines(frame_file.rename(other), 1, {}).rows({"indirect", "depth", "normal", "mask"})
    part = rows.read(start, stop)
    for name in ("indirect", "depth", "normal", "mask"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[start:stop])
    assert part.albedo is None and (rows.height, rows.width) == (24, 40)


def test_rows_far_into_another_data_window(tmp_path, rng):
    """A crop's rows are counted from its own first one."""
    image = {c: rng.random((30, 8), np.float32) for c in ("depth.Z", "R", "G", "B")}
    types = dict.fromkeys(image, np.float32)
    path, window = tmp_path / "crop.exr", exr.Window((-3, 17), (0, 0, 99, 99))
    with exr.writing_rows(path, (30, 8), types, '{"a": 1}', window) as append:
        for row in (0, 13):
            append({c: plane[row : row + 13 + 4 * (row > 0)] for c, plane in image.items()})
    attributes = exr.read_attributes(path)
    assert attributes.window == window and attributes.comments == '{"a": 1}'
    assert attributes.size == (30, 8)
    for name, plane in exr.read_channels(path).items():
        np.testing.assert_array_equal(plane, image[name])
    part = Scanlines(path, 1, {"depth": "depth"}).part(11, 14, {"depth"})
    np.testing.assert_array_equal(part.channels["depth.Z"], image["depth.Z"][11:14])
    assert part.attributes.window.origin == (-3, 28)


@pytest.mark.parametrize("limit", ["imagesize_MB", "resolution", "channels"])
def test_a_sound_file_is_read_whatever_its_size(tmp_path, rng, limit):
    """Also where OpenImageIO would refuse it: what is sound is decided in one place."""
    import OpenImageIO

    image = {c: rng.random((500, 600), np.float32) for c in ("depth.Z", "R", "G", "B")}
    exr.write_channels(tmp_path / "a.exr", image)
    OpenImageIO.attribute(f"limits:{limit}", 1)
    part = Scanlines(tmp_path / "a.exr", 1, {}).part(490, 494, {"depth"})
    np.testing.assert_array_equal(part.channels["depth.Z"], image["depth.Z"][490:494])


def test_a_file_in_strips_is_the_file_denoised(frame_file, tmp_path):
    whole, ours = tmp_path / "whole.exr", tmp_path / "strips.exr"
    assert main(["denoise", str(frame_file), "-o", str(whole)]) == 0
    arguments = parser().parse_args(["denoise", str(frame_file), "-o", str(ours)])
    denoiser = jflnr.Denoiser(**settings_of(arguments))
    record = denoise_in_strips(Job(frame_file, ours), denoiser, arguments, tile=16)
    assert (record["status"], record["width"], record["height"]) == ("written", 40, 24)
    wanted, found = exr.read_channels(whole), exr.read_channels(ours)
    assert found.keys() == wanted.keys()
    for name, plane in wanted.items():
        np.testing.assert_allclose(found[name], plane, rtol=1e-4, atol=1e-5)
    first, second = (jflnr.read_header(path) for path in (whole, ours))
    assert json.dumps(first) == json.dumps(second)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize(
    "options",
    ["--png", "--reference", "--lobes", "--channels all"],
)
def test_what_needs_the_whole_frame_is_named(frame_file, tmp_path, options):
    command = ["denoise", str(frame_file), "-o", str(tmp_path / "o.exr"), *options.split()]
    arguments = parser().parse_args(command)
    denoiser, job = jflnr.Denoiser(**settings_of(arguments)), Job(frame_file, tmp_path / "o.exr")
    with pytest.raises(ValueError, match=f"{options} needs the whole frame in memory: raise"):
        denoise_in_strips(job, denoiser, arguments, 16)


def test_a_method_without_stages_needs_the_whole_frame():
    with pytest.raises(ValueError, match="bmfr needs the whole frame in memory: raise --mem"):
        tile_for(8192, 16384, 1 << 30, 1, method_of("bmfr"))
