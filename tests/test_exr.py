"""EXR files: what is written is read back, and every unusable file gives one clear sentence."""

import os
import re
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from jflnr import exr

RNG = np.random.default_rng(0)


def pixels(height: int = 9, width: int = 13, dtype: type = np.float16) -> np.ndarray:
    return RNG.random((height, width)).astype(dtype)


def part(name: str, channels: dict[str, np.ndarray], left: int = 0) -> OpenEXR.Part:
    height, width = next(iter(channels.values())).shape
    corners = np.array([left, 0], np.int32), np.array([left + width - 1, height - 1], np.int32)
    display = np.array([0, 0], np.int32), np.array([63, 63], np.int32)
    header = {
        "dataWindow": corners,
        "displayWindow": display,
        "type": OpenEXR.scanlineimage,
    }
    return OpenEXR.Part(header, channels, name)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "good.exr"
    exr.write_channels(path, {f"layer_{i}.R": pixels(40, 30, np.float32) for i in range(3)})
    return path


def test_channels_survive_with_type_header_and_window(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    channels = {
        "R": pixels(),
        "depth.Z": pixels(dtype=np.float32),
        "id.I": np.arange(9 * 13, dtype=np.uint32).reshape(9, 13),
    }
    window = exr.Window(origin=(5, -7), display=(0, 0, 99, 49))
    others = {"Camera": "left", "worldToCamera": 2 * np.eye(4, dtype=np.float32)}
    exr.write_channels(path, channels, '{"scene": "é"}', window, others)
    read = exr.read_channels(path)
    assert read.keys() == channels.keys()
    for name, expected in channels.items():
        assert read[name].dtype == expected.dtype
        np.testing.assert_array_equal(read[name], expected)
    attributes = exr.read_attributes(path)
    assert attributes[:4] == ('{"scene": "é"}', "ZIP", 1, window)
    assert attributes.others["Camera"] == "left"
    np.testing.assert_array_equal(attributes.others["worldToCamera"], others["worldToCamera"])


def test_values_that_are_not_finite_survive(tmp_path: Path) -> None:
    values = np.array([[np.nan, np.inf, -np.inf, 65504]], np.float16)
    exr.write_channels(tmp_path / "a.exr", {"R": values})
    np.testing.assert_array_equal(exr.read_channels(tmp_path / "a.exr")["R"], values)


def test_layers_split_at_the_last_dot() -> None:
    names = ("ViewLayer.Diffuse Color.R", "ViewLayer.Diffuse Color.G", "depth.Z", "R")
    assert exr.layers_of(dict.fromkeys(names)) == {
        "ViewLayer.Diffuse Color": ["R", "G"],
        "depth": ["Z"],
        "": ["R"],
    }


def test_parts_are_merged_under_their_layer_names(tmp_path: Path) -> None:
    path = tmp_path / "parts.exr"
    albedo, depth = pixels(), pixels()
    parts = [part("albedo", {"R": albedo}), part("any", {"V.depth.Z": depth})]
    OpenEXR.File([*parts, part("again", {"V.depth.Z": albedo})]).write(str(path))
    read = exr.read_channels(path)
    assert list(read) == ["albedo.R", "V.depth.Z", "again.V.depth.Z"]
    np.testing.assert_array_equal(read["V.depth.Z"], depth)
    assert exr.read_attributes(path).parts == 3


@pytest.mark.parametrize("tiled", [False, True])
@pytest.mark.parametrize("packing", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "DWAA"])
def test_other_kinds_of_file_are_read(tmp_path: Path, packing: str, tiled: bool) -> None:
    path, values = tmp_path / "a.exr", pixels(70, 90, np.float32)
    header = {"compression": getattr(OpenEXR, f"{packing}_COMPRESSION")}
    header["type"] = OpenEXR.tiledimage if tiled else OpenEXR.scanlineimage
    if tiled:
        header["tiles"] = OpenEXR.TileDescription()
    OpenEXR.File(header, {"R": values}).write(str(path))
    np.testing.assert_allclose(exr.read_channels(path)["R"], values, atol=0.05)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"gone\.exr: there is no such file"):
        exr.read_channels(tmp_path / "gone.exr")


def test_a_folder(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError, match="is a folder, not an EXR file"):
        exr.read_channels(tmp_path)


def test_not_an_exr(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(b"")
    with pytest.raises(ValueError, match="is empty"):
        exr.read_channels(path)
    path.write_bytes(b"\x89PNG and so on")
    with pytest.raises(ValueError, match="is not an EXR file"):
        exr.read_channels(path)


@pytest.mark.parametrize("share", [0.001, 0.01, 0.03, 0.1, 0.5, 0.99])
def test_truncated(file: Path, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[: max(int(share * len(whole)), 5)])
    with pytest.raises(ValueError, match="truncated or damaged"):
        exr.read_channels(file)
    assert capfd.readouterr() == ("", "")  # OpenEXR's own remarks stay away from the terminal


@pytest.mark.parametrize("corner", [(-1, -1), (-1, 5), (5, -1), (-(2**31), 2**31 - 1)])
def test_zero_size(file: Path, corner: tuple[int, int]) -> None:
    file.write_bytes(with_data_window(file.read_bytes(), (0, 0, *corner)))
    with pytest.raises(ValueError, match="has zero size"):
        exr.read_channels(file)


def test_writing_zero_size(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="has zero size"):
        exr.write_channels(tmp_path / "a.exr", {"R": pixels(0, 5)})
    with pytest.raises(ValueError, match="has zero size"):
        exr.write_channels(tmp_path / "a.exr", {})


@pytest.mark.parametrize("side", [20_000, 60_000, 200_000, 2**31 - 1])
def test_absurd_size_asks_for_no_memory(file: Path, side: int) -> None:
    file.write_bytes(with_data_window(file.read_bytes(), (0, 0, side - 1, side - 1)))
    with pytest.raises(ValueError, match="damaged"):
        exr.read_channels(file)


def test_absurd_size_is_named(file: Path) -> None:
    file.write_bytes(with_data_window(file.read_bytes(), (0, 0, 59_999, 59_999)))
    with pytest.raises(ValueError, match="announces 60000 x 60000 pixels of 3 channels"):
        exr.read_channels(file)


def test_sizes_that_disagree(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    OpenEXR.File([part("a", {"R": pixels(4, 5)}), part("b", {"R": pixels(4, 6)})]).write(str(path))
    with pytest.raises(ValueError, match=re.escape("a.R is 5 x 4, b.R is 6 x 4")):
        exr.read_channels(path)
    with pytest.raises(ValueError, match="sizes disagree"):
        exr.write_channels(path, {"a.R": pixels(4, 5), "b.R": pixels(5, 5)})


def test_parts_that_lie_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    parts = [part("a", {"R": pixels()}), part("b", {"R": pixels()}, left=3)]
    OpenEXR.File(parts).write(str(path))
    with pytest.raises(ValueError, match="its parts do not start at the same pixel"):
        exr.read_channels(path)


def test_types_that_exr_lacks(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"float16, float32, uint32; b\.R is float64"):
        exr.write_channels(tmp_path / "a.exr", {"a.R": pixels(), "b.R": pixels(dtype=np.float64)})


def test_unwritable(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"a\.exr cannot be written: No such file or directory"):
        exr.write_channels(tmp_path / "gone" / "a.exr", {"R": pixels()})
    (tmp_path / "folder.exr").mkdir()
    with pytest.raises(OSError, match=r"folder\.exr cannot be written: it is a folder"):
        exr.write_channels(tmp_path / "folder.exr", {"R": pixels()})
    assert [p.name for p in tmp_path.iterdir()] == ["folder.exr"]


def test_a_failed_write_leaves_the_old_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = file.read_bytes()

    class Interrupted:
        def __init__(self, *_: object) -> None: ...

        def write(self, path: bytes) -> None:
            Path(os.fsdecode(path)).write_bytes(before[:50])
            raise KeyboardInterrupt

    monkeypatch.setattr(OpenEXR, "File", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        exr.write_channels(file, {"R": pixels()})
    assert file.read_bytes() == before
    assert [p.name for p in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("packing", ["NO", "ZIP", "PIZ", "DWAA"])
def test_damaged_files_never_do_worse_than_value_error(tmp_path: Path, packing: str) -> None:
    """Truncations and flipped bytes; what OpenEXR cannot notice is read as what it then is."""
    path = tmp_path / "a.exr"
    header = {"compression": getattr(OpenEXR, f"{packing}_COMPRESSION")}
    OpenEXR.File(header, {f"l{i}.R": pixels() for i in range(4)}).write(str(path))
    whole, rng = path.read_bytes(), np.random.default_rng(1)
    for trial in range(250):
        damaged = bytearray(whole)
        header_only = trial % 2
        for _ in range(rng.integers(1, 4)):
            damaged[rng.integers(4, 450 if header_only else len(whole))] = rng.integers(256)
        if trial % 5 == 0:
            del damaged[rng.integers(4, len(whole)) :]
        path.write_bytes(damaged)
        try:
            channels = exr.read_channels(path)
            exr.read_attributes(path)
        except ValueError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert all(image.ndim == 2 and image.size for image in channels.values())


def with_data_window(file: bytes, window: tuple[int, int, int, int]) -> bytes:
    """The file with another data window in its header."""
    key = b"dataWindow\0box2i\0\x10\0\0\0"
    start = file.index(key) + len(key)
    return file[:start] + struct.pack("<4i", *window) + file[start + 16 :]


def test_rows_make_the_file_that_the_whole_does(tmp_path: Path, rng: np.random.Generator) -> None:
    """To the byte, whatever the header holds; also where they begin in another data window."""
    names = ("depth.Z", "R", "G", "B", "a.B", "Z")
    image = {name: rng.random((30, 8), np.float32) for name in names}
    about = '{"a": 1}', exr.Window((-3, 17), (0, 0, 99, 99)), {"artist": "é", "gain": 2.5}
    exr.write_channels(tmp_path / "a.exr", image, *about)
    types = dict.fromkeys(image, np.float32)
    with exr.writing_rows(tmp_path / "b.exr", (30, 8), types, *about) as append:
        for start, stop in ((0, 13), (13, 14), (14, 30)):
            append({name: pixels[start:stop] for name, pixels in image.items()})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_rows_of_several_types(tmp_path: Path, rng: np.random.Generator) -> None:
    image = {"a": rng.random((4, 5)).astype(np.float16), "b": rng.random((4, 5), np.float32)}
    image["c"] = rng.integers(0, 9, (4, 5), np.uint32)
    types = {name: pixels.dtype for name, pixels in image.items()}
    with exr.writing_rows(tmp_path / "a.exr", (4, 5), types) as append:
        append(image)
    for name, pixels in exr.read_channels(tmp_path / "a.exr").items():
        np.testing.assert_array_equal(pixels, image[name], strict=True)


def test_rows_that_are_interrupted_leave_nothing(tmp_path: Path) -> None:
    with (
        pytest.raises(KeyboardInterrupt),
        exr.writing_rows(tmp_path / "a.exr", (4, 4), {"R": np.float32}) as append,
    ):
        append({"R": np.zeros((2, 4), np.float32)})
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
