"""Which files belong together, and what they are called."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from jflnr import exr, layouts
from jflnr.cli import main
from jflnr.frame import Frame, write_frame
from jflnr.report.page import find_crops
from jflnr.report.scenes import Scene, collect
from tests.layouts.blender_passes import passes


def write_output(path: Path, image: np.ndarray, layer: str = "indirect.") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.float32(image)
    exr.write_channels(path, {f"{layer}{c}": pixels[..., i] for i, c in enumerate("RGB")})
    return path


def test_outputs_are_named_by_file_or_by_folder(tmp_path: Path, frame: Frame) -> None:
    source = tmp_path / "room.exr"
    write_frame(source, frame)
    outputs = [
        write_output(tmp_path / folder / name, 0.5 * frame.indirect)
        for folder, name in (("flr", "room.exr"), ("mine", "room.exr"), ("mine", "other.exr"))
    ]
    (scene,) = collect([outputs[0], source, *outputs[1:]], 1, None)
    assert list(scene.images) == ["noisy", "flr", "mine", "other", "reference"]
    np.testing.assert_array_equal(scene.images["flr"], 0.5 * frame.indirect)
    np.testing.assert_array_equal(scene.images["reference"], frame.reference)


def test_several_frames_take_the_outputs_that_have_their_names(
    tmp_path: Path, frame: Frame
) -> None:
    sources, outputs = [tmp_path / "a.exr", tmp_path / "b.exr"], []
    for share, source in enumerate(sources):
        write_frame(source, dataclasses.replace(frame, reference=None, reference_a=None))
        outputs.append(write_output(tmp_path / "out" / source.name, share * frame.indirect))
    a, b = collect([*sources, *outputs], 1, None)
    assert (list(a.images), a.images["out"].max()) == (["noisy", "out"], 0)
    np.testing.assert_array_equal(b.images["out"], frame.indirect)
    stray = write_output(tmp_path / "c.exr", frame.indirect)
    with pytest.raises(ValueError, match=r"none is called c\.exr"):
        collect([*sources, stray], 1, None)


def test_plain_pictures_need_a_reference_to_be_measured(tmp_path: Path, frame: Frame) -> None:
    a = write_output(tmp_path / "a.exr", 1.5 * frame.albedo, layer="")
    b = write_output(tmp_path / "b.exr", frame.albedo, layer="")
    (scene,) = collect([a, b], 1, None)
    assert list(scene.images) == ["a", "b"]
    (scene,) = collect([a], 1, b)
    assert list(scene.images) == ["a", "reference"]
    y = np.float64(frame.albedo)
    assert scene.measure("a")["mse"] == pytest.approx(np.mean((0.5 * y) ** 2), rel=1e-6)


def test_a_picture_of_another_program_alone(tmp_path: Path, frame: Frame) -> None:
    exr.write_channels(tmp_path / "render.exr", passes(frame))
    (scene,) = collect([tmp_path / "render.exr"], 1, None)
    assert list(scene.images) == ["noisy"]


@pytest.mark.parametrize("by", ["--reference", "--map"])
def test_pictures_of_other_programs_are_compared_whole(
    by: str, tmp_path: Path, frame: Frame
) -> None:
    source = tmp_path / "render.exr"
    exr.write_channels(source, passes(frame))
    out = write_output(tmp_path / "out" / "render.exr", 0.5 * frame.albedo, layer="")
    clean = write_output(tmp_path / "clean.exr", frame.albedo, layer="")
    given = (clean, {}) if by == "--reference" else (None, {"reference": str(clean)})
    (scene,) = collect([source, out], 1, *given)
    assert list(scene.images) == ["noisy", "out", "reference"]
    np.testing.assert_array_equal(scene.images["noisy"], layouts.picture(passes(frame), ""))
    right = np.mean((0.5 * np.float64(frame.albedo)) ** 2)
    assert scene.measure("out")["mse"] == pytest.approx(right, rel=1e-6)


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("plain with frame", "holds no layer indirect"),
        ("reference with frame", "--reference is for pictures"),
        ("sizes", "one size"),
        ("folder", "is a folder"),
    ],
)
def test_what_cannot_be_compared_is_said_in_one_sentence(
    case: str,
    said: str,
    tmp_path: Path,
    frame: Frame,
    frame_file: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plain = write_output(tmp_path / "plain.exr", frame.albedo, layer="")
    small = write_output(tmp_path / "small.exr", frame.indirect[1:])
    argv = {
        "plain with frame": [frame_file, plain],
        "reference with frame": [frame_file, "--reference", plain],
        "sizes": [frame_file, small],
        "folder": [plain],
    }[case]
    output = tmp_path if case == "folder" else tmp_path / "report.html"
    assert main(["report", *map(str, argv), "-o", str(output)]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (tmp_path / "report.html").exists()


def test_a_page_that_exists_is_kept(
    tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "report.html"
    page.write_text("precious")
    assert main(["report", str(frame_file), "-o", str(page)]) == 0
    assert page.read_text() == "precious"
    assert "--overwrite" in capsys.readouterr().out


def test_crops_find_where_the_versions_differ() -> None:
    image = np.full((100, 140, 3), 0.2, np.float32)
    changed = image.copy()
    changed[60:70, 90:100] = 1
    changed[10:14, 10:14] = 1
    scene = Scene("s", {"a": changed, "b": image, "reference": image})
    first, second = find_crops(scene, size=32)
    assert first["x"] <= 90 < 100 <= first["x"] + 32 and first["y"] <= 60 < 70 <= first["y"] + 32
    assert second["x"] <= 10 and second["y"] <= 10
    for crop in find_crops(Scene("s", {"a": image[:9, :11]})):
        assert (crop["y"], crop["size"]) == (0, 9) and crop["x"] in (0, 1, 2)
