"""EXR files with damaged or odd headers: read and passed on, or one sentence, in little memory."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from jflnr import exr, layouts
from jflnr.cli import main
from tests.fuzz.test_arrays import long, short
from tests.fuzz.test_files import damaged, little_memory

reuse = [HealthCheck.function_scoped_fixture, *HealthCheck]
NUMBERS = [0, 1, -1, 2**31 - 1, -(2**31), 2**16, 127, 128, 255]
BYTES = st.one_of(
    st.binary(min_size=1, max_size=9),
    st.sampled_from(NUMBERS).map(lambda n: (n % 2**32).to_bytes(4, "little")),
    st.sampled_from([np.float32(n).tobytes() for n in (np.nan, np.inf, 1e38, -1.0)]),
)
PLACES = st.one_of(st.floats(0, 1), st.floats(0, 0.5))
DAMAGE = st.tuples(st.sampled_from(["cut", "insert", "write", "write", "write"]), PLACES, BYTES)
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.sampled_from(["camera", "origin", "target", "up", "fov_x"]), inner),
    ),
    max_leaves=12,
)
ATTRIBUTES = st.dictionaries(
    st.sampled_from(["worldToCamera", "samplesPerPixel", "cycles.x.samples", "artist", "é"]),
    st.one_of(
        st.text(max_size=9),
        st.floats(width=32),
        st.integers(-(2**31), 2**31 - 1),
        st.just(np.eye(4, dtype=np.float32)),
        st.just(np.full((4, 4), np.nan, np.float32)),
    ),
    max_size=3,
)
PIXELS = np.ones((3, 4), np.float32)
LAYERS = ("R G B", "R G B Z albedo.R albedo.G albedo.B normal.X normal.Y normal.Z", "é.R x")


@little_memory()
def read_and_passed_on_or_refused(folder, capsys, layers, comments, others, damage):
    path, out = folder / "a.exr", folder / "out.exr"
    channels, window = dict.fromkeys(layers.split(), PIXELS), exr.Window((2, 1), (0, 0, 9, 9))
    exr.write_channels(path, channels, json.dumps(comments), window, others)
    content = path.read_bytes()
    for one in damage:
        content = damaged(content, *one)
    path.write_bytes(content)
    code = main(["info", str(path)])
    said = capsys.readouterr()
    assert code in (0, 2) and said.err.count("\n") == code // 2
    if code == 0:
        source = layouts.load(path)
        pixels = {"R": next(iter(source.channels.values()))}
        exr.write_channels(
            out,
            pixels,
            json.dumps(source.header),
            source.attributes.window,
            source.attributes.others,
        )
        exr.read_channels(out)


HEADERS = {
    "layers": st.sampled_from(LAYERS),
    "comments": JSON,
    "others": ATTRIBUTES,
    "damage": st.lists(DAMAGE, max_size=3),
}


@short(max_examples=100, suppress_health_check=reuse)
@given(**HEADERS)
def test_headers(tmp_path, capsys, layers, comments, others, damage):
    read_and_passed_on_or_refused(tmp_path, capsys, layers, comments, others, damage)


@pytest.mark.slow
@long(max_examples=25000, suppress_health_check=reuse)
@given(**HEADERS)
def test_headers_long(tmp_path, capsys, layers, comments, others, damage):
    read_and_passed_on_or_refused(tmp_path, capsys, layers, comments, others, damage)
