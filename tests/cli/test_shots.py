"""`jflnr denoise --temporal`, `--history`, `--method bmfr`: order, state, interruption."""

import dataclasses
import json
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import jax
import numpy as np
import pytest

from jflnr import cluster, exr, history, temporal
from jflnr.bmfr import pipeline as bmfr
from jflnr.cli import main
from jflnr.cli.jobs import Job, plan
from jflnr.cli.shots import shots_of
from jflnr.frame import Frame, read_frame, read_header, write_frame
from jflnr.opencl import NoDevice, all_devices
from jflnr.parameters import save_parameters
from jflnr.regression.flr import FLR

NAMES = [f"f_{i}.exr" for i in (1, 2, 3, 10)]  # in an order that is not that of the alphabet


@pytest.fixture
def shot(tmp_path: Path, frame: Frame) -> Path:
    """Four frames of a still camera, each with noise of its own."""
    folder = tmp_path / "shot"
    folder.mkdir()
    rng = np.random.default_rng(2)
    for name in NAMES:
        noisy = frame.reference * rng.exponential(size=frame.indirect.shape).astype(np.float32)
        still = np.zeros_like(frame.motion)
        write_frame(folder / name, dataclasses.replace(frame, indirect=noisy, motion=still))
    return folder


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[Frame]:
    """In place of the denoiser, the mean of all frames so far; the frames that it was given."""
    seen: list[Frame] = []

    def start(frame: Frame, **_: object) -> dict:
        return {"count": np.zeros(1), "sum": np.zeros_like(frame.indirect)}

    def step(state: dict, frame: Frame, method: str, **_: object) -> tuple[dict, np.ndarray]:
        seen.append(frame)
        after = {"count": state["count"] + 1, "sum": state["sum"] + frame.indirect}
        return after, after["sum"] / after["count"]

    monkeypatch.setattr(temporal, "start", start)
    monkeypatch.setattr(temporal, "step", step)
    return seen


def run(*argv: object) -> int:
    """By JAX, unless the arguments say what by."""
    return main(["denoise", "--temporal", "--backend", "jax", *map(str, argv)])


def light(path: Path) -> np.ndarray:
    channels = exr.read_channels(path)
    return np.stack([channels[f"indirect.{c}"] for c in "RGB"], axis=-1)


def means(shot: Path) -> list[np.ndarray]:
    """What the stand-in makes of the frames in order."""
    noisy = [read_frame(shot / name).indirect for name in NAMES]
    return [np.mean(noisy[: i + 1], axis=0) for i in range(len(noisy))]


def check(out: Path, expected: list[np.ndarray]) -> None:
    assert sorted(path.name for path in out.iterdir()) == sorted(NAMES)
    for name, image in zip(NAMES, expected, strict=True):
        np.testing.assert_allclose(light(out / name), image, rtol=1e-6)


@pytest.mark.usefixtures("steps")
def test_frames_follow_each_other_in_natural_order(shot: Path, tmp_path: Path) -> None:
    assert run(shot, "-o", tmp_path / "out") == 0
    check(tmp_path / "out", means(shot))


@pytest.mark.usefixtures("steps")
def test_every_folder_is_a_shot(shot: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for name in NAMES:
        shutil.copy(shot / name, other / f"g{name}")
    jobs = plan([other, shot], tmp_path / "out")
    assert [[job.source.parent for job in found] for found in shots_of(jobs)] == [
        [other] * 4,
        [shot] * 4,
    ]
    assert run(other, shot, "-o", tmp_path / "out") == 0
    for name, image in zip(NAMES, means(shot), strict=True):
        np.testing.assert_allclose(light(tmp_path / "out" / f"g{name}"), image, rtol=1e-6)
        np.testing.assert_allclose(light(tmp_path / "out" / name), image, rtol=1e-6)


@pytest.mark.usefixtures("steps")
def test_on_a_cluster_a_shot_is_one_job(
    shot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask itself is tried in tests/large; here, that what travels can travel."""
    given: list[list[Job]] = []

    def each(address: str, work: Callable, jobs: list, failed: Callable) -> Iterator:
        given.extend(jobs)
        return (pickle.loads(pickle.dumps(work))(job) for job in jobs)

    monkeypatch.setattr(cluster, "each", each)
    assert run(shot, "-o", tmp_path / "out", "--cluster") == 0
    assert [[job.source.name for job in jobs] for jobs in given] == [NAMES]
    check(tmp_path / "out", means(shot))


@pytest.mark.parametrize("missing", [[3], [1], [0, 2]])
def test_a_run_goes_on_as_if_it_had_not_stopped(
    missing: list[int], shot: Path, tmp_path: Path, steps: list[Frame]
) -> None:
    out = tmp_path / "out"
    assert run(shot, "-o", out) == 0
    kept = {name: (out / name).stat().st_mtime_ns for name in NAMES}
    for i in missing:
        (out / NAMES[i]).unlink()
    steps.clear()
    assert run(shot, "-o", out) == 0
    check(out, means(shot))
    steps.pop()  # the first frame of a run is denoised twice
    assert len(steps) == max(missing) + 1  # what comes after the last one is not needed
    for i, name in enumerate(NAMES):
        assert i in missing or (out / name).stat().st_mtime_ns == kept[name]
    steps.clear()
    assert run(shot, "-o", out) == 0 and not steps


def test_a_history_takes_the_place_of_what_was_before(
    shot: Path, tmp_path: Path, steps: list[Frame]
) -> None:
    """One frame a run, as a renderer hands them over."""
    out, state = tmp_path / "out", tmp_path / "state.npz"
    for count, name in enumerate(NAMES):
        assert run(shot / name, "-o", out, "--history", state) == 0
        steps.pop()
        assert len(steps) == count + 1
    check(out, means(shot))
    assert run(shot, "-o", out, "--history", state) == 0 and len(steps) == len(NAMES)


def test_a_shot_goes_on_from_its_history(shot: Path, tmp_path: Path, steps: list[Frame]) -> None:
    out, state = tmp_path / "out", tmp_path / "state.npz"
    first = tmp_path / "first"
    first.mkdir()
    for name in NAMES[:2]:
        shutil.copy2(shot / name, first / name)
    assert run(first, "-o", out, "--history", state) == 0
    steps.clear()
    assert run(shot, "-o", out, "--history", state) == 0
    check(out, means(shot))
    assert len(steps) == 2 + 1


@pytest.mark.usefixtures("steps")
def test_a_frame_that_failed_is_made_good_later(
    shot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, state = tmp_path / "out", tmp_path / "state.npz"
    whole = (shot / NAMES[1]).read_bytes()
    (shot / NAMES[1]).write_bytes(whole[:2000])
    assert run(shot, "-o", out, "--history", state) == 3
    assert NAMES[1] in capsys.readouterr().err
    assert sorted(p.name for p in out.iterdir()) == sorted({*NAMES} - {NAMES[1]})
    (shot / NAMES[1]).write_bytes(whole)
    assert run(shot, "-o", out, "--history", state) == 0
    np.testing.assert_allclose(light(out / NAMES[1]), means(shot)[1], rtol=1e-6)


Refusal = Callable[[Path, Path], list[object]]


@pytest.mark.usefixtures("steps")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (lambda shot, state: [shot, "--history", state, "--overwrite"], "delete it"),
        (lambda shot, state: [shot, "--history", state, "--method", "flr-adaptive"], "--method"),
        (lambda shot, state: [shot, "--history", shot / NAMES[0]], "would replace an input"),
        (lambda shot, state: [shot, "--history", state, "--block", "4"], "--block"),
        (lambda shot, state: [shot, "--history", state, "--backend", "opencl"], "jax backend"),
        (
            lambda shot, state: [shot, "--method", "bmfr", "--guides", "normal", "--overwrite"],
            "own features",
        ),
        (lambda shot, state: [shot, shot.parent / "b", "--history", state], "one shot"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    arguments: Refusal,
    sentence: str,
    shot: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "b").mkdir()
    shutil.copy(shot / NAMES[0], tmp_path / "b" / "other.exr")
    state = tmp_path / "state.npz"
    assert run(shot, "-o", tmp_path / "out", "--history", state) == 0
    before = state.read_bytes()
    assert run(*arguments(shot, state), "-o", tmp_path / "out") == 2
    printed = capsys.readouterr().err
    assert sentence in printed and "Traceback" not in printed and state.read_bytes() == before


@pytest.mark.usefixtures("steps")
def test_a_history_is_of_one_size(
    shot: Path, tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture[str]
) -> None:
    state = tmp_path / "state.npz"
    assert run(shot, "-o", tmp_path / "out", "--history", state) == 0
    small = jax.tree.map(lambda layer: layer[:9], frame)
    write_frame(tmp_path / "small.exr", small)
    assert run(tmp_path / "small.exr", "-o", tmp_path / "out", "--history", state) == 2
    assert "another size" in capsys.readouterr().err


def test_motion_comes_from_the_cameras_where_there_is_none(
    shot: Path, tmp_path: Path, steps: list[Frame], capsys: pytest.CaptureFixture[str]
) -> None:
    for i, name in enumerate(NAMES):
        frame = dataclasses.replace(read_frame(shot / name), motion=None)
        matrix = np.eye(4)
        matrix[0, 3] = 0.1 * i  # to the left
        header = {"camera_to_world": matrix.tolist(), "fov_x_degrees": 60}
        write_frame(shot / name, frame, header=header if i < 3 else None)
    assert run(shot, "-o", tmp_path / "out") == 0
    by_hand = 0.1 / frame.depth[..., 0] * 20 / np.tan(np.radians(30))
    np.testing.assert_allclose(steps[-2].motion[..., 0], -by_hand, rtol=1e-4)
    np.testing.assert_array_equal(steps[-1].motion, 0)
    assert "stand still" in capsys.readouterr().err


def test_bmfr_is_its_own_step_function(shot: Path, tmp_path: Path) -> None:
    assert run(shot, "-o", tmp_path, "--method", "bmfr", "--json") == 0
    frames = [read_frame(shot / name) for name in NAMES]
    state = bmfr.start(frames[0])
    for name, frame in zip(NAMES, frames, strict=True):
        state, image = bmfr.step(state, frame)
        np.testing.assert_allclose(light(tmp_path / name), image, rtol=1e-5, atol=1e-6)


def test_a_fitted_block_is_used_over_time(shot: Path, tmp_path: Path) -> None:
    params, out = tmp_path / "p.json", tmp_path / "out"
    save_parameters(params, FLR(6, 1e-3, 1e-3), block=4)
    assert run(shot, "-o", out, "--params", params, "--guides", "depth") == 0
    state = temporal.start(read_frame(shot / NAMES[0]), guides=("depth",))
    method = FLR(6, 1e-3, 1e-3, block=4)
    for name in NAMES:
        frame = read_frame(shot / name)
        state, image = temporal.step(state, frame, method, guides=("depth",))
        np.testing.assert_allclose(light(out / name), image, rtol=1e-5, atol=1e-6)
        assert read_header(out / name)["denoiser"]["block"] == 4


def test_a_history_is_what_was_written(tmp_path: Path) -> None:
    state = {"a": np.arange(6.0).reshape(2, 3), "b": (np.int32(4), np.ones(2, np.float32))}
    path = tmp_path / "state.npz"
    about = {"options": {}, "last": ["f.exr", 1], "header": {}}
    history.write(path, state, about)
    found = history.read(path)
    assert found.about == json.loads(json.dumps(found.about)) == about
    again = found.state({"a": np.zeros((2, 3)), "b": (np.int32(0), np.zeros(2, np.float32))})
    np.testing.assert_array_equal(again["a"], state["a"])
    assert again["b"][0] == 4 and again["b"][1].dtype == np.float32
    assert os.listdir(tmp_path) == ["state.npz"]
    with pytest.raises(ValueError, match="another size"):
        found.state({"a": np.zeros((2, 4)), "b": (np.int32(0), np.zeros(2, np.float32))})


def test_shots_keep_the_order_of_their_folders() -> None:
    jobs = [Job(Path(name), Path("out") / name) for name in ("b/2", "a/10", "a/9", "b/1")]
    assert [[str(job.source) for job in shot] for shot in shots_of(jobs)] == [
        ["b/1", "b/2"],
        ["a/9", "a/10"],
    ]


def test_the_kernels_give_the_same(shot: Path, tmp_path: Path) -> None:
    try:
        all_devices()
    except NoDevice as error:
        pytest.skip(str(error))
    for backend in ("jax", "opencl"):
        assert run(shot, "-o", tmp_path / backend, "--backend", backend) == 0
    ours, right = (light(tmp_path / backend / NAMES[-1]) for backend in ("opencl", "jax"))
    np.testing.assert_allclose(ours, right, atol=1e-3 * right.max())
