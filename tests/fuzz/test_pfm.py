"""PFM files and standard input of any form: read, or one sentence, in little memory."""

import io
import sys
import tempfile

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given
from hypothesis import strategies as st

from jflnr import exr
from jflnr.cli import main
from tests.fuzz.test_arrays import long, short
from tests.fuzz.test_files import damaged, little_memory
from tests.fuzz.test_headers import BYTES, DAMAGE

reuse = [HealthCheck.function_scoped_fixture, *HealthCheck]
SPACES = st.sampled_from([b"\n", b" ", b"\r\n", b"\r", b"\t\n ", b"", b"#\n", b"\n" * 10_000])
SIZES = st.one_of(
    st.integers(0, 5).map(str),
    st.sampled_from(["1000000000", "999999999", "4294967296", "-3", "03", "1e3", "9" * 10_000]),
).map(str.encode)
SCALES = st.one_of(
    st.sampled_from(["-1.0", "1", "-2.5e-3", ".5", "0", "-0.0", "nan", "-inf", "1e400", "...", ""]),
    st.floats(width=32).map(str),
    st.just("-" + "1" * 10_000),
).map(str.encode)
PIXELS = st.one_of(st.binary(max_size=60), st.integers(0, 75).map(lambda n: b"\n\x80\x7f\xff" * n))
KINDS = st.sampled_from([b"PF", b"Pf", b"PF", b"pf", b"P6", b"PF4", b"\xef\xbb\xbfPF"])
PFM = st.tuples(KINDS, SPACES, SIZES, SPACES, SIZES, SPACES, SCALES, SPACES, PIXELS).map(b"".join)
WHOLE = st.builds(
    lambda kind, h, w, scale, end: (
        b"%s\n%d %d\n%s%s" % (kind, w, h, scale, end)
        + b"\n\x80\x7f\xff" * (w * h * (3 if kind == b"PF" else 1))
    ),
    st.sampled_from([b"PF", b"Pf"]),
    st.integers(1, 4),
    st.integers(1, 4),
    SCALES,
    st.sampled_from([b"\n", b"\r\n", b"\r", b" "]),
)
DAMAGED = st.builds(lambda content, damage: damaged(content, *damage), WHOLE, DAMAGE)
FILES = st.one_of(PFM, WHOLE, DAMAGED)


@little_memory()
def read_and_written_or_refused(folder, capsys, content):
    path, out = folder / "a.pfm", folder / "out.pfm"
    path.write_bytes(content)
    code = main(["info", str(path)])
    said = capsys.readouterr()
    assert code in (0, 2) and said.err.count("\n") == code // 2
    if code == 2:
        assert str(path) in said.err and len(said.err) < 500
        return
    channels = exr.read_channels(path)
    assert sum(pixels.nbytes for pixels in channels.values()) < len(content)
    picture = {name: channels.get(name, channels.get("Y")) for name in "RGB"}
    exr.write_channels(out, picture)
    for name, pixels in exr.read_channels(out).items():
        np.testing.assert_array_equal(pixels, picture[name])


@short(max_examples=200, suppress_health_check=reuse)
@given(content=FILES)
@example(content=b"PF\n1000000000 1000000000\n-1.0\n")
@example(content=b"PF 1 1 -1.0\r\n" + bytes(12))
def test_pfm(tmp_path, capsys, content):
    read_and_written_or_refused(tmp_path, capsys, content)


@pytest.mark.slow
@long(max_examples=10000, suppress_health_check=reuse)
@given(content=FILES)
def test_pfm_long(tmp_path, capsys, content):
    read_and_written_or_refused(tmp_path, capsys, content)


def small(folder):
    """A frame that is soon denoised."""
    path, layers = folder / "small.exr", ("indirect_1", "albedo", "emission", "direct")
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    names = [f"{layer}.{c}" for layer in layers for c in "RGB"]
    names += ["depth.Z", *(f"normal.{c}" for c in "XYZ")]
    exr.write_channels(path, dict.fromkeys(names, pixels))
    return path.read_bytes()


STREAMS = st.one_of(
    st.one_of(FILES, st.binary(max_size=200), BYTES.map(lambda b: exr.MAGIC + b)).map(
        lambda content: (content, [])
    ),
    st.tuples(st.none(), st.lists(DAMAGE, max_size=3)),
)


@little_memory()
def standard_input_is_denoised_or_refused(folder, capsys, monkeypatch, stream):
    content, damage = stream
    content = small(folder) if content is None else content
    for one in damage:
        content = damaged(content, *one)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))
    out = folder / "out.exr"
    code = main(["denoise", "-", "-o", str(out), "--backend", "opencl"])
    said = capsys.readouterr()
    assert tempfile.gettempdir() + "/tmp" not in said.out + said.err
    if code == 0:
        assert exr.read_channels(out)
        return out.unlink()
    assert code == 2 and not out.exists()
    assert not said.out and said.err.count("\n") == 1 and "standard input" in said.err
    assert len(said.err) < 500


@short(max_examples=100, suppress_health_check=reuse)
@given(stream=STREAMS)
@example(stream=(None, [("insert", 0.8602969851547391, b"~\0\0\0")]))
def test_standard_input(tmp_path, capsys, monkeypatch, stream):
    standard_input_is_denoised_or_refused(tmp_path, capsys, monkeypatch, stream)


@pytest.mark.slow
@long(max_examples=10000, suppress_health_check=reuse)
@given(stream=STREAMS)
def test_standard_input_long(tmp_path, capsys, monkeypatch, stream):
    standard_input_is_denoised_or_refused(tmp_path, capsys, monkeypatch, stream)
