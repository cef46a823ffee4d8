"""PFM files, against bytes written by hand."""

import struct
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr

# Two pixels side by side, the lower row first.
LOWER, UPPER = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (-1.0, 0.5, 1e30, 0.0, 7.0, 8.0)


@pytest.mark.parametrize(("scale", "order"), [("-1.0", "<"), ("1", ">")])
def test_rows_and_byte_orders(tmp_path: Path, scale: str, order: str) -> None:
    path = tmp_path / "a.PFM"
    path.write_bytes(f"PF\n2 2\n{scale}\n".encode() + struct.pack(f"{order}12f", *LOWER, *UPPER))
    channels = exr.read_channels(path)
    assert exr.read_attributes(path).size == (2, 2)
    for i, name in enumerate("RGB"):
        right = np.float32([UPPER[i::3], LOWER[i::3]])
        np.testing.assert_array_equal(channels[name], right)
    if order == "<":
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
    ],
)
def test_what_is_none_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.pfm").write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.pfm is (not a|a truncated or damaged) PFM file"):
        exr.read_channels(tmp_path / "a.pfm")
    with pytest.raises(OSError, match="no such file"):
        exr.read_channels(tmp_path / "b.pfm")
