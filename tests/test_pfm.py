"""PFM files, against bytes written by hand."""

import struct
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr

# Two pixels side by side, the lower row first.
LOWER, UPPER = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (-1.0, 0.5, 1e30, 0.0, 7.0, 8.0)


@pytest.mark.parametrize("line", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("scale", "order"),
    [("-1.0", "<"), ("1", ">"), ("-2.5", "<"), ("+5e-1", ">"), ("-1e-05", "<")],
)
def test_rows_byte_orders_and_scales(tmp_path: Path, scale: str, order: str, line: str) -> None:
    path = tmp_path / "a.PFM"
    data = struct.pack(f"{order}12f", *LOWER, *UPPER)
    path.write_bytes(f"PF{line}2 2{line}{scale}{line}".encode() + data)
    channels = exr.read_channels(path)
    assert exr.read_attributes(path).size == (2, 2)
    for i, name in enumerate("RGB"):
        right = np.float32([UPPER[i::3], LOWER[i::3]]) * np.float32(abs(float(scale)))
        np.testing.assert_array_equal(channels[name], right)
    if (scale, line) == ("-1.0", "\n"):
        exr.write_channels(tmp_path / "b.pfm", channels | {"A": channels["R"]})
        assert (tmp_path / "b.pfm").read_bytes() == path.read_bytes()


def test_one_channel(tmp_path: Path) -> None:
    (tmp_path / "a.pfm").write_bytes(b"Pf 1 2 -1 " + struct.pack("<2f", 3, 4))
    assert exr.read_channels(tmp_path / "a.pfm")["Y"].tolist() == [[4], [3]]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"v/1\1",
        b"PF\n2 2\n",
        b"PF\n2 2\n-1\n1234",
        b"PF\n0 9\n-1\n",
        b"PF\n-1 -1\n-1\n" + 12 * b"0",
        b"PF\n999999999 999999999\n-1.0\n" + 12 * b"0",
        b"PF\n1000000000 1000000000\n-1.0\n" + 12 * b"0",
        b"PF\n1 1\n0\n" + 12 * b"0",
        b"PF\n1 1\n-1e400\n" + 12 * b"0",
        b"PF\n1 1\n-1e-400\n" + 12 * b"0",
        b"PF\n1 1\n-inf\n" + 12 * b"0",
        b"PF\n1 1\n...\n" + 12 * b"0",
        b"PF\n1 1\n-1\n\n\n" + 12 * b"0",
        b"PF" + 10_000 * b" " + b"1 1 -1 " + 12 * b"0",
    ],
)
def test_what_is_none_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.pfm").write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.pfm is (not a|a truncated or damaged) PFM file"):
        exr.read_channels(tmp_path / "a.pfm")
    with pytest.raises(OSError, match="no such file"):
        exr.read_channels(tmp_path / "b.pfm")


def test_a_file_far_larger_than_its_header_says_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "a.pfm").open("wb") as file:
        file.write(b"PF\n2 2\n-1\n")
        file.truncate(1 << 40)
    with pytest.raises(ValueError, match=r"a\.pfm is a truncated or damaged PFM file"):
        exr.read_channels(tmp_path / "a.pfm")
