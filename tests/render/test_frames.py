"""Files: layers and header, resumption, the manifest, splits, sequences and the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jflnr
from experiments.rendering import command, frame
from experiments.rendering.dataset import Job, evaluation_jobs, fill, training_jobs
from experiments.rendering.manifest import Manifest
from experiments.rendering.reference import Accumulator, Goal
from experiments.rendering.sequence import BALL, MOVER, Shot
from experiments.rendering.splits import TEST, VAL
from experiments.rendering.tracer import Tracer
from jflnr.exr import read_attributes, read_channels, write_channels

SMALL = ["--width", "48", "--height", "27", "--reference-spp", "64", "--direct-spp", "8"]


def test_a_frame_on_disk(tmp_path: Path) -> None:
    path = tmp_path / "room.exr"
    arguments = ["room", "-o", str(path), *SMALL, "--spp", "1", "4", "--realisations", "3"]
    assert command.main(arguments) == 0
    channels = read_channels(path)
    layers = {name.split(".")[0] for name in channels}
    assert {"indirect_1", "indirect_1_b", "indirect_1_c", "indirect_4", "reference_a"} <= layers
    assert channels["depth.Z"].dtype == np.float32 and channels["ao.Y"].dtype == np.float16
    a, b = (channels[f"indirect_1{s}.R"].astype(float) for s in ("", "_b"))
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.3 and not np.array_equal(a, b)
    facts = json.loads(read_attributes(path).comments)
    assert facts["reference_spp"] == 64 and facts["scene"] == "room" and facts["split"] == "train"
    read = jflnr.read_frame(path, spp=4)
    assert read.indirect.shape == (27, 48, 3)
    before = path.stat().st_mtime_ns
    assert command.main(arguments) == 0
    assert path.stat().st_mtime_ns == before
    assert [p.name for p in tmp_path.iterdir()] == ["room.exr"]


def test_a_frame_again_from_its_header(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second, other = (tmp_path / name for name in ("a.exr", "b.exr", "c.exr"))
    arguments = ["forms-1", "-o", str(first), *SMALL, "--spp", "1", "2", "--realisations", "2"]
    assert command.main([*arguments, "--view", "101", "--seed", "7", "--nee-only"]) == 0
    assert command.main(["again", str(first), "-o", str(second)]) == 0
    a, b = (read_channels(path) for path in (first, second))
    assert a.keys() == b.keys()
    repeatable = [n for n in a if not n.startswith("reference")]
    off = [np.mean(~np.isclose(a[n], b[n], rtol=2e-3, atol=1e-3)) for n in repeatable]
    assert max(off) < 0.01
    reference, again = (
        np.mean([c[f"reference.{x}"].astype(float) for x in "RGB"], axis=0) for c in (a, b)
    )
    assert again.mean() == pytest.approx(reference.mean(), rel=0.03)
    one, two = (json.loads(read_attributes(p).comments) for p in (first, second))
    varying = {"reference_processor_seconds", "reference_samples_per_processor_second"}
    varying |= {"reference_sampling", "reference_median_relative_standard_error"}
    assert {k: v for k, v in one.items() if k not in varying} == {
        k: v for k, v in two.items() if k not in varying
    }
    channels = read_channels(first)
    channels["depth.Z"] = channels["depth.Z"] * 1.1
    write_channels(other, channels, read_attributes(first).comments)
    assert command.main(["again", str(other), "-o", str(tmp_path / "d.exr")]) == 2
    assert "its scene forms-1 has changed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["castle", "-o", "x.exr"], "there is no scene 'castle' of ours"),
        (["nowhere/scene.xml", "-o", "x.exr"], "there is no scene file"),
        (["room", "-o", "x.exr", "--width", "0"], "--width must be at least 1"),
        (["room", "-o", "x.exr", "--spp", "0"], "--spp takes sample counts"),
    ],
)
def test_errors_are_one_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command.main(arguments) == 2
    printed = capsys.readouterr().err
    assert sentence in printed and "Traceback" not in printed


def test_a_reference_resumes_where_it_stopped(tracer: Tracer, tmp_path: Path) -> None:
    state = tmp_path / "state.npz"
    settings = frame.Settings(64, 36, mis=False)
    mask = tracer.guides["mask"][..., 0] > 0
    first = Accumulator.of(tracer, settings, 1, mask, state)
    first.run(Goal(0.0, 64, 64))
    first.save()
    second = Accumulator.of(tracer, settings, 1, mask, state)
    assert second.spp == 64
    np.testing.assert_array_equal(second.sums, first.sums)
    second.run(Goal(0.0, 128, 128))
    assert second.spp == 128
    other = Accumulator.of(tracer, settings, 2, mask, state)
    assert other.spp == 0
    half = second.first_half()
    np.testing.assert_allclose(half, mask[..., None] * second.sums[:2].sum(0) / 64, rtol=1e-12)


def test_the_stated_error_is_the_error(tracer: Tracer) -> None:
    """The median relative standard error, against the spread of repeated references."""
    settings = frame.Settings(64, 36, mis=False)
    mask = tracer.guides["mask"][..., 0] > 0
    made = []
    for seed in range(6):
        reference = Accumulator.of(tracer, settings, seed, mask)
        reference.run(Goal(0.0, 64, 64))
        made.append(reference)
    means = np.stack([r.mean().mean(-1) for r in made])
    lit = mask & (means.mean(0) > 0)
    spread = np.median(means.std(0, ddof=1)[lit] / means.mean(0)[lit])
    assert np.mean([r.relative_error() for r in made]) == pytest.approx(spread, rel=0.25)


def test_a_data_set_resumes_and_keeps_finished_frames(tmp_path: Path) -> None:
    jobs = [Job("forms-1", view, 48, 27) for view in (100, 101)]
    said: list[str] = []
    assert fill(tmp_path, iter(jobs[:1]), 9, said.append) == 1
    before = (tmp_path / jobs[0].name).stat().st_mtime_ns
    assert fill(tmp_path, iter(jobs), 9, said.append) == 2
    assert (tmp_path / jobs[0].name).stat().st_mtime_ns == before and len(said) == 2
    entry = Manifest(tmp_path).entries[jobs[1].name]
    assert entry["scene"] == "forms-1" and entry["view"] == 101 and len(entry["sha256"]) == 64
    assert Manifest(tmp_path).summary("train", 1.0).startswith("2 frames of 1 scenes")
    with pytest.raises(ValueError, match="split by scene"):
        fill(tmp_path, iter([Job("sponza", 0, 48, 27, "train")]), 9)


def test_training_jobs_hold_no_reserved_scene() -> None:
    jobs = [job for job, _ in zip(training_jobs(), range(600), strict=False)]
    assert not {job.scene for job in jobs} & {*VAL, *TEST}
    assert len({job.scene for job in jobs}) > 200 and len({job.name for job in jobs}) == 600


@pytest.mark.parametrize("motion", ["camera", "object", "light"])
def test_motion_vectors_lead_to_the_same_point(room: Any, motion: str) -> None:
    shot = Shot.of(room, room.own[0], motion, 2)
    width, height = 160, 90
    old, tracer = (Tracer.of(shot.scene(i), shot.camera(i), width, height) for i in range(2))
    vectors = shot.motion_vectors(tracer, 1)
    assert (shot.motion_vectors(old, 0) == 0).all()
    if motion == "light":
        np.testing.assert_allclose(vectors, 0, atol=1e-3)
        return
    y, x = np.mgrid[:height, :width] + 0.5
    column, row = np.floor(np.stack([x, y]) + vectors.transpose(2, 0, 1)).astype(int)
    on = tracer.shows(MOVER) if motion == "object" else tracer.guides["depth"][..., 0] > 0
    on &= (column >= 0) & (column < width) & (row >= 0) & (row < height)
    assert on.sum() > 50
    there = old.guides["position"][np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    here = tracer.guides["position"].astype(float)
    if motion == "object":
        now, before = shot.mover(1), shot.mover(0)
        assert now is not None and before is not None
        back = before @ np.linalg.inv(now)
        here = here @ back[:3, :3].T + back[:3, 3]
    off = np.linalg.norm(there - here, axis=-1)[on]
    depth = float(np.median(old.guides["depth"]))
    assert np.quantile(off, 0.6) < (BALL if motion == "object" else 0.02) * depth


def test_a_switched_light_has_two_references_and_fresh_noise(tmp_path: Path) -> None:
    arguments = ["room", "-o", str(tmp_path), *SMALL, "--motion", "switch", "--frames", "4"]
    assert command.main(arguments) == 0
    frames = [jflnr.read_frame(path) for path in sorted(tmp_path.glob("*.exr"))]
    assert [jflnr.read_header(path)["frame"] for path in sorted(tmp_path.glob("*.exr"))] == [
        *range(4)
    ]
    same = [[np.array_equal(a.reference, b.reference) for a in frames] for b in frames]
    assert same == [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1], [0, 0, 1, 1]]
    assert len({frame.indirect.tobytes() for frame in frames}) == 4


def test_every_scene_of_val_and_test_gets_a_frame_and_a_sequence() -> None:
    for split, scenes in (("val", VAL), ("test", TEST)):
        jobs = list(evaluation_jobs(split))
        assert len({job.name for job in jobs}) == len(jobs) == 21 * len(scenes)
        assert {job.scene for job in jobs if job.motion} == set(scenes)


def test_a_job_of_a_sequence_makes_its_frame(tmp_path: Path) -> None:
    job = Job("forms-1", 100, 48, 27, motion="camera", number=1)
    assert fill(tmp_path, iter([job]), 1) == 1
    facts = jflnr.read_header(tmp_path / "train/forms-1_camera/forms-1_camera_001.exr")
    assert facts["motion"] == "camera" and facts["frame"] == 1
