"""Command lines and parameter files of any form: exit 0 or 2, one sentence, no partial output."""

import functools
import json
import math

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from jflnr.cli import main
from jflnr.parameters import load_parameters, numbers_of
from jflnr.regression.adaptive import AdaptiveFLR
from tests.fuzz.test_files import little_memory

short = functools.partial(settings, deadline=None, derandomize=True, database=None)
long = functools.partial(settings, deadline=None, database=None)
# The files of `folder` are only read, so that one serves all examples.
reuse = [HealthCheck.function_scoped_fixture, *HealthCheck]

WORDS = st.sampled_from(
    "denoise info metrics fit devices -o --output --spp --method --backend --guides --params "
    "--sigma --eps --eps-prime --block --png --reference --overwrite --json --steps --help "
    "--temporal --history --explain --error-map --lobes --map --memory --channels --profile "
    "--version -- - -1 0 1 8 nan inf 1e400 1M flr flr-adaptive flnr flnr-small bmfr auto "
    "picture jax opencl normal,depth colour depth=Z all , frame.exr junk.exr empty.exr params.json "
    "nowhere/out.exr folder . ..".split()
)
LINES = st.lists(st.one_of(WORDS, WORDS, st.text(max_size=8)), max_size=7)


@pytest.fixture
def folder(tmp_path, monkeypatch, frame_file):
    (tmp_path / "junk.exr").write_bytes(b"v/1\x01 but not really" * 9)
    (tmp_path / "empty.exr").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    (tmp_path / "params.json").write_text('{"format": "jflnr-parameters", "version": 1}')
    monkeypatch.chdir(tmp_path)
    return tmp_path


def holds_a_frame(folder, word):
    """Also an empty word is the folder itself."""
    path = folder / word.replace("\0", "")
    return path.is_relative_to(folder) and (folder / "frame.exr").is_relative_to(path.resolve())


def answers(folder, capsys, line):
    """Only lines that denoise or fit a good frame are left out: they take long and are tested."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    if {"denoise", "fit"} & set(line):
        line = [word for word in line if not holds_a_frame(folder, word)]
    try:
        code = main(line)
    except SystemExit as leaving:
        code = leaving.code
    output = capsys.readouterr()
    assert code in (0, 2), (line, code)
    assert "Traceback" not in output.err
    if code == 2:
        # One for each input at most, and a warning.
        assert 0 < len(output.err.strip().splitlines()) <= len(line) + 1, output.err
    assert before == {path: path.stat().st_mtime_ns for path in folder.rglob("*")}, line


@short(max_examples=150, suppress_health_check=reuse)
@given(line=LINES)
def test_any_command_line(folder, capsys, line):
    answers(folder, capsys, line)


def test_an_argument_of_many_lines(folder, capsys):
    answers(folder, capsys, ["info", "frame.exr", "--none", "a\nb\vc\u2028d\n\ne"])


@pytest.mark.slow
@long(max_examples=5000, suppress_health_check=reuse)
@given(line=LINES)
def test_any_command_line_long(folder, capsys, line):
    answers(folder, capsys, line)


NUMBERS = st.one_of(
    st.floats(),
    st.integers(),
    st.sampled_from([10**400, True, None, "3", "1e3", [], {}, 1e308, 5e-324]),
)
FILES = st.one_of(
    st.binary(max_size=200),
    st.fixed_dictionaries(
        {},
        optional={
            "format": st.sampled_from(["jflnr-parameters", "jflnr", 1, None]),
            "version": st.sampled_from([1, 2, "1", None]),
            "sigma": NUMBERS,
            "eps": NUMBERS,
            "eps_prime": NUMBERS,
        },
    ).map(lambda d: json.dumps(d).encode()),
    st.fixed_dictionaries(
        dict.fromkeys(numbers_of(AdaptiveFLR()), NUMBERS),
        optional={"method": st.sampled_from(["flr", "flr-adaptive", "auto", None, 1, [], {}])},
    ).map(lambda d: json.dumps({"format": "jflnr-parameters", "version": 1, **d}).encode()),
)


@little_memory()
def loads_or_refuses(folder, content):
    path = folder / "p.json"
    path.write_bytes(content)
    try:
        method, _ = load_parameters(path)
    except ValueError as error:
        assert 10 < len(str(error)) < 500
    else:
        assert all(math.isfinite(n) and n > 0 for n in numbers_of(method).values())


@short(max_examples=200, suppress_health_check=reuse)
@given(content=FILES)
@example(content=b"[" * 100_000)
@example(content=b'{"format": "jflnr-parameters", "version": ' + b"9" * 9999 + b"}")
def test_any_parameter_file(tmp_path, content):
    loads_or_refuses(tmp_path, content)


@pytest.mark.slow
@long(max_examples=25000, suppress_health_check=reuse)
@given(content=FILES)
def test_any_parameter_file_long(tmp_path, content):
    loads_or_refuses(tmp_path, content)
