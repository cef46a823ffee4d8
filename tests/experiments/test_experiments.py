"""The machinery of the experiments, and the quick versions of a few of them."""

import numpy as np
import pytest

import jflnr
from experiments import data, results, resume, shots
from experiments.__main__ import main
from experiments.catalogue import NAMES
from experiments.peers import tikhonov
from experiments.plots import front
from experiments.sweeps import TABLE, grouped, summed, traced_at
from jflnr.regression.flr import FLR


def test_position_from_depth_is_the_layer(data):
    from experiments.data import position

    path = data / "val" / "dining-room_0.exr"
    frame = jflnr.read_frame(path)
    ours = position(frame, jflnr.read_header(path))
    seen = frame.mask[..., 0] > 0
    scale = np.abs(frame.position[seen]).max()
    assert np.abs(ours - frame.position)[seen].max() < 2e-3 * scale


def test_streams_are_weighted_by_their_samples(data):
    from experiments.data import read

    path = data / "val" / "dining-room_0.exr"
    one, four = (jflnr.read_frame(path, n).indirect for n in (1, 4))
    both = read(path, 1, 4).indirect
    np.testing.assert_allclose(both, (one + 4 * four) / 5, rtol=1e-5)


def test_the_front_holds_what_nothing_beats():
    points = [(1, 20), (2, 25), (2, 24), (3, 22), (4, 30), (0.5, 10), (5, 30)]
    assert front(points) == [5, 0, 1, 4]


def test_interrupted_rows_are_not_redone(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path)
    calls = []

    def row(key):
        calls.append(key)
        if key == "c" and calls.count("c") == 1:
            raise KeyboardInterrupt
        return {"key": key}

    with pytest.raises(KeyboardInterrupt):
        resume.rows("trial", "abc", row)
    assert resume.rows("trial", "abc", row) == [{"key": key} for key in "abc"]
    assert calls == ["a", "b", "c", "c"]
    monkeypatch.setattr(resume, "code_version", lambda: "other")
    resume.rows("trial", "a", row)
    assert calls[-1] == "a"
    resume.forget("trial")
    assert not list(tmp_path.iterdir())


def test_tikhonov_without_and_with_too_much(frame):
    # No regularisation: both are plain least squares. Too much: nothing is left.
    plain = jflnr.denoise(frame, FLR(15.0, 1e-9, 1e-9))
    free = np.asarray(tikhonov.denoise(frame, eps=1e-9))
    assert np.median(np.abs(free - np.asarray(plain))) < 3e-2 * np.mean(free)
    assert np.abs(tikhonov.denoise(frame, eps=1e6)).max() < 1e-2


def test_light_groups_are_a_partition(frame):
    parts = grouped(frame, 3).indirect.reshape(24, 40, 3, 3)
    np.testing.assert_allclose(parts.sum(axis=2), frame.indirect, rtol=1e-5)
    whole = np.asarray(jflnr.denoise(frame))
    found = summed(grouped(frame, 3), backend="jax")
    np.testing.assert_allclose(found, whole, atol=1e-4 * whole.mean())


def test_tracing_smaller_keeps_the_light(frame):
    small = traced_at(frame, 4)
    assert small.indirect.shape == (6, 10, 3)
    np.testing.assert_allclose(small.indirect.mean(), frame.indirect.mean(), rtol=1e-4)


@pytest.mark.parametrize("name", ["upsample"])
def test_quick_versions_leave_evidence(name, tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", name, "--quick", "--out", str(tmp_path)]) == 0
    (measured,) = results.read(tmp_path / f"{name}.json")
    assert measured["quick"] and measured["versions"]["jax"] and measured["commit"]
    (row, *_) = measured["parts"]["means"]
    (frame,) = measured["parts"]["PSNR by frame, dB"][:1]
    assert row["psnr"] == frame[data.label(data.SHIPPED)] and row["ms"] > 0


def test_cases_are_told_apart():
    for sweep in TABLE.values():
        labels = [tuple(case.labels.items()) for case in sweep.cases()]
        assert len(set(labels)) == len(labels) > 1, sweep.NAME
    assert set(TABLE) < set(NAMES)


def test_sequences_are_measured_without_any_at_hand(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", "sequences", "--quick", "--out", str(tmp_path)]) == 0
    parts = results.parts(results.read(tmp_path / "sequences.json"))
    of = lambda part: {row["method"]: row["made up"] for row in parts[part]}
    assert of("PSNR, dB")["flr, temporal"] > of("PSNR, dB")["flr"]
    flicker = of("warped error x 1000")
    assert flicker["flr, temporal"] < flicker["flr"] / 2
    assert flicker["reference"] < 1e-3 < of("temporal error")["reference"]


def test_a_made_up_sequence_moves_as_it_says():
    """What `motion` leads to in the frame before is the same place, under other noise."""
    before, now = shots.made_up(2).frames
    x, y = now.motion[0, 0].astype(int)
    assert (x, y) == (2, 0)
    for name in ("position", "albedo", "reference"):
        np.testing.assert_array_equal(getattr(now, name)[:, :-x], getattr(before, name)[:, x:])
    assert not np.array_equal(now.indirect[:, :-x], before.indirect[:, x:])
    assert now.indirect.mean() == pytest.approx(now.reference.mean(), rel=0.2)


def test_every_experiment_says_what_it_asks(capsys):
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all("?" in line for line in lines)


def test_unknown_experiment_is_one_sentence(capsys):
    assert main(["run", "nothing"]) == 2
    assert "none of the experiments" in capsys.readouterr().err


def test_tables_are_markdown():
    text = results.table([{"a": 1.23456, "b": "x"}], {"a": "A", "b": "B", "c": "C"})
    assert text.splitlines() == ["| A | B | C |", "| --- | --- | --- |", "| 1.235 | x |  |"]


def test_without_data_the_shipped_frame_is_used(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("JFLNR_DATA", str(tmp_path))
    assert data.frames("test") == [data.SHIPPED]
    assert "JFLNR_DATA" in capsys.readouterr().out
