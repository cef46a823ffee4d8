"""Files of numbers and words that nobody vouches for: bounded, and of the form that we write."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from jflnr import history
from jflnr.cli import main
from jflnr.files import json_object
from jflnr.methods import method_of
from jflnr.network.checkpoint import load_state, save_state
from jflnr.parameters import load_parameters, save_parameters

ABOUT = {"options": {}, "last": ["a.exr", 1, 2], "header": {}}
STATE = {"light": np.ones((4, 5, 3), np.float32)}


@pytest.mark.parametrize("text", ["[" * 50_000, '{"a":' * 50_000, '{"a": ' + "9" * 5000 + "}", "3"])
def test_json_of_no_bounds_is_no_object(text: str) -> None:
    assert json_object(text) == {}


def test_what_is_read_can_be_written() -> None:
    """However deep it is, there is no depth at which reading works and writing does not."""
    for depth in range(1, 1200, 7):
        json.dumps({"outer": json_object('{"a":' * depth + "0" + "}" * depth)})


def rewritten(path: Path, **changed: np.ndarray) -> None:
    with np.load(path) as before:
        arrays = {name: before[name] for name in before.files} | changed
    np.savez(path, **arrays)


@pytest.mark.parametrize("kind", ["history", "state"])
def test_what_unpacks_to_more_is_refused(tmp_path: Path, kind: str) -> None:
    path, packed = tmp_path / "a.npz", io.BytesIO()
    np.savez_compressed(packed, zeros=np.zeros(10_000_000))
    path.write_bytes(packed.getvalue())
    with pytest.raises(ValueError, match=r"a\.npz"):
        history.read(path) if kind == "history" else load_state(path, STATE, {})


@pytest.mark.parametrize("lost", list(ABOUT))
def test_a_history_that_does_not_say_what_it_is(tmp_path: Path, lost: str) -> None:
    history.write(tmp_path / "a.npz", STATE, ABOUT)
    assert history.read(tmp_path / "a.npz").about == ABOUT
    history.write(tmp_path / "a.npz", STATE, {k: v for k, v in ABOUT.items() if k != lost})
    with pytest.raises(ValueError, match=r"a\.npz"):
        history.read(tmp_path / "a.npz")


def test_a_history_of_words(tmp_path: Path) -> None:
    history.write(tmp_path / "a.npz", STATE, ABOUT)
    rewritten(tmp_path / "a.npz", array0=np.full((4, 5, 3), "x"))
    with pytest.raises(ValueError, match=r"a\.npz"):
        history.read(tmp_path / "a.npz").state(STATE)


@pytest.mark.parametrize(
    "changed",
    [
        {"header": np.frombuffer(b"[" * 5000, np.uint8)},
        {"header": np.frombuffer(b'{"run": {}}', np.uint8)},
        {"header": np.zeros(3)},
        {"leaf0": np.zeros((4, 5))},
    ],
    ids=str,
)
def test_a_changed_state_is_refused(tmp_path: Path, changed: dict[str, np.ndarray]) -> None:
    path = tmp_path / "a.state"
    save_state(path, STATE, [], {})
    np.testing.assert_array_equal(load_state(path, STATE, {})[0]["light"], STATE["light"])
    with path.open("rb") as file, np.load(file) as before:
        arrays = {name: before[name] for name in before.files} | changed
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with pytest.raises(ValueError, match=r"a\.state"):
        load_state(path, STATE, {})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sigma", True),
        ("sigma", "15"),
        ("sigma", 10**400),
        ("sigma", -1),
        ("eps", float("nan")),
        ("guides", ["x"]),
        ("guides", [["normal"]]),
        ("guides", "normal"),
        ("block", 0),
        ("block", "8"),
    ],
)
def test_a_parameter_file_says_what_is_wrong(
    tmp_path: Path, frame_file: Path, name: str, value: object, capsys: pytest.CaptureFixture
) -> None:
    path = tmp_path / "p.json"
    save_parameters(path, method_of("flr"), guides=["normal"], block=8)
    assert load_parameters(path)[1]["guides"] == ["normal"]
    path.write_text(json.dumps(json.loads(path.read_text()) | {name: value}))
    with pytest.raises(ValueError, match=r"p\.json: "):
        load_parameters(path)
    argv = ["denoise", str(frame_file), "-o", str(tmp_path / "o.exr"), "--params", str(path)]
    assert main(argv) == 2 and "p.json" in capsys.readouterr().err
