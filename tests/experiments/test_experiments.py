"""The machinery of the experiments, and the quick versions of a few of them."""

import json

import numpy as np
import pytest

import jflnr
from experiments import data, results, resume, shots
from experiments.__main__ import main
from experiments.lightgroups import error_of_sum, grouped
from experiments.pareto import pareto_front
from experiments.regularisation import denoised, normalised, tikhonov
from experiments.upsample import traced_at
from jflnr.regression.flr import DEFAULT


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
    assert pareto_front(points) == [5, 0, 1, 4]


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


def test_normalised_solver_is_that_of_flr(frame):
    ours = denoised(frame, normalised, float(DEFAULT.eps), float(DEFAULT.eps_prime))
    np.testing.assert_allclose(ours, jflnr.denoise(frame), rtol=2e-3)


def test_tikhonov_without_and_with_too_much(frame):
    # No regularisation: both are plain least squares. Too much: nothing is left.
    free = [np.asarray(denoised(frame, s, 1e-9, 1e-9)) for s in (normalised, tikhonov)]
    assert np.median(np.abs(free[0] - free[1])) < 1e-2
    assert np.abs(denoised(frame, tikhonov, 1e6, 1e6)).max() < 1e-2


def test_light_groups_are_a_partition(frame):
    parts = grouped(frame, 3).indirect.reshape(24, 40, 3, 3)
    np.testing.assert_allclose(parts.sum(axis=2), frame.indirect, rtol=1e-5)
    assert error_of_sum(frame, 3, "jax") < 1e-4


def test_tracing_smaller_keeps_the_light(frame):
    small = traced_at(frame, 4)
    assert small.indirect.shape == (6, 10, 3)
    np.testing.assert_allclose(small.indirect.mean(), frame.indirect.mean(), rtol=1e-4)


@pytest.mark.parametrize("name", ["upsample"])
def test_quick_versions_leave_evidence_and_charts(name, tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", name, "--quick", "--out", str(tmp_path)]) == 0
    evidence = json.loads((tmp_path / f"{name}.json").read_bytes())
    assert evidence["quick"] and evidence["environment"]["versions"]["jax"]
    assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    monkeypatch.setattr("experiments.report.scenes", lambda out: [])  # tests/report has those
    assert main(["report", "--out", str(tmp_path), "--docs", str(tmp_path / "docs")]) == 0
    assert f"{name}: rows" in (tmp_path / "report.html").read_text()
    assert (tmp_path / "docs" / f"{name}.md").read_text().startswith("| ")


def test_sequences_are_measured_without_any_at_hand(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", "sequences", "--quick", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "sequences.json").read_bytes())["result"]["rows"]
    found = {row["method"]: row for row in rows}
    alone, over_time = found["flr"], found["flr, temporal"]
    assert over_time["psnr"] > alone["psnr"] and over_time["warped"] < alone["warped"] / 2
    assert found["reference"]["warped"] < 1e-6 < found["reference"]["temporal"]
    assert "| made up | flr, temporal |" in (tmp_path / "sequences_figures.md").read_text()
    assert (tmp_path / "sequences.png").stat().st_size > 10_000


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
