"""Blender's files: by the names of both generations, and (slow) as the real program writes them."""

import json
import os
import re
import subprocess
import sys
import venv
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from jflnr import denoising, exr, layouts
from jflnr.cli import main
from jflnr.frame import Frame, composite, read_frame
from tests.layouts.blender_passes import passes


def beauty(path: Path, layer: str = "ViewLayer.Combined") -> np.ndarray:
    channels = exr.read_channels(path)
    return np.stack([channels[f"{layer}.{c}"] for c in "RGB"], -1)


@pytest.fixture(params=[False, True], ids=["since 5.0", "up to 4.x"])
def blender_file(request: pytest.FixtureRequest, tmp_path: Path, frame: Frame) -> Path:
    path = tmp_path / "render.exr"
    exr.write_channels(path, passes(frame, old=request.param))
    return path


@pytest.fixture
def identity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of either method."""
    same = lambda self, frame: frame.indirect if self.method else frame.beauty
    monkeypatch.setattr(denoising.Denoiser, "__call__", same)


def test_layers_are_those_of_the_passes(blender_file: Path, frame: Frame) -> None:
    read = read_frame(blender_file)
    np.testing.assert_array_equal(read.indirect[5:], frame.indirect[5:])
    np.testing.assert_array_equal(read.direct[5:], frame.direct[5:])
    np.testing.assert_array_equal(read.albedo[5:], frame.albedo[5:])
    np.testing.assert_array_equal(read.normal, frame.normal)
    np.testing.assert_array_equal(read.position, frame.position)
    np.testing.assert_array_equal(read.motion, frame.motion)
    assert read.ao is None  # one ray per sample would be noise, not a guide


def test_sky_has_no_depth_and_neither_it_nor_a_mirror_is_denoised(blender_file: Path) -> None:
    read = read_frame(blender_file)
    assert (read.depth[:3] == 0).all() and (read.depth[3:] > 0).all()
    assert (read.mask[:5] == 0).all() and (read.mask[5:] == 1).all()


def test_the_composite_is_the_beauty_if_nothing_is_denoised(blender_file: Path) -> None:
    read = read_frame(blender_file)
    np.testing.assert_allclose(composite(read, read.indirect), beauty(blender_file), rtol=1e-5)


def test_other_light_passes_through(blender_file: Path) -> None:
    """What changes in the picture is albedo times the change of the light, and nothing else."""
    read = read_frame(blender_file)
    change = composite(read, read.indirect + 1) - beauty(blender_file)
    np.testing.assert_allclose(change, read.albedo, atol=1e-5)
    assert (change[:5] == 0).all()


def test_light_that_is_not_finite_gives_way(tmp_path: Path, frame: Frame) -> None:
    channels = passes(frame)
    for name in ("Diffuse Indirect", "Combined"):
        channels[f"ViewLayer.{name}.R"][7, 8] = np.inf
    exr.write_channels(tmp_path / "a.exr", channels)
    read = read_frame(tmp_path / "a.exr")
    assert np.isinf(read.indirect[7, 8, 0])
    assert np.isfinite(composite(read, np.ones_like(read.indirect))).all()


def test_parts_and_the_picture_before_blenders_own_denoiser(tmp_path: Path, frame: Frame) -> None:
    """Blender 5 writes one part per pass; `Noisy Image` is the picture that the passes sum to."""
    channels = passes(frame)
    for c in "RGB":
        channels[f"ViewLayer.Noisy Image.{c}"] = channels[f"ViewLayer.Combined.{c}"].copy()
        channels[f"ViewLayer.Combined.{c}"] *= 0
    by_layer = {exr.layer_of(n): {} for n in channels}
    for name, pixels in channels.items():
        by_layer[exr.layer_of(name)][name] = pixels
    header = {"type": OpenEXR.scanlineimage}
    parts = [OpenEXR.Part(dict(header), own, name) for name, own in by_layer.items()]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    read = read_frame(tmp_path / "a.exr")
    noisy = beauty(tmp_path / "a.exr", "ViewLayer.Noisy Image")
    np.testing.assert_allclose(composite(read, read.indirect), noisy, rtol=1e-5)


def test_denoising_data_alone_will_do(tmp_path: Path, frame: Frame) -> None:
    names = {"Combined": "Combined", "Diffuse Color": "Denoising Albedo"}
    names |= {"Normal": "Denoising Normal", "Depth": "Denoising Depth"}
    channels = {}
    for name, pixels in passes(frame).items():
        _, layer, component = name.split(".")
        if layer in names:
            channels[f"ViewLayer.{names[layer]}.{component}"] = pixels
    exr.write_channels(tmp_path / "a.exr", channels)
    read, picture = read_frame(tmp_path / "a.exr"), beauty(tmp_path / "a.exr")
    np.testing.assert_allclose(read.indirect[5:], picture[5:] / frame.albedo[5:], rtol=1e-5)
    np.testing.assert_allclose(composite(read, read.indirect), picture, rtol=1e-5)


def test_the_view_layer_with_passes_is_taken(tmp_path: Path, frame: Frame) -> None:
    channels = passes(frame, view="Room.001")
    for view in ("Composite", "Fog"):
        channels |= {f"{view}.Combined.{c}": frame.ao[..., 0] for c in "RGBA"}
    exr.write_channels(tmp_path / "a.exr", channels)
    source = layouts.load(tmp_path / "a.exr")
    assert source.layout.channels["indirect"][0] == "Room.001.Diffuse Indirect.R"
    assert "Composite, Fog" in source.layout.notes[-1]


def test_a_missing_pass_says_where_to_switch_it_on(tmp_path: Path, frame: Frame) -> None:
    left = {n: pixels for n, pixels in passes(frame).items() if ".Normal." not in n}
    exr.write_channels(tmp_path / "a.exr", left)
    with pytest.raises(ValueError, match=r"layer ViewLayer\.Normal is missing; switch on Normal"):
        read_frame(tmp_path / "a.exr")


def test_depth_may_be_missing(tmp_path: Path, frame: Frame) -> None:
    left = {n: pixels for n, pixels in passes(frame).items() if ".Depth." not in n}
    exr.write_channels(tmp_path / "a.exr", left)
    read = read_frame(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.depth[..., 0], np.any(frame.normal != 0, axis=-1))


def test_metrics_find_the_picture(
    blender_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = {c: beauty(blender_file)[..., i] for i, c in enumerate("RGB")}
    exr.write_channels(tmp_path / "same.exr", picture)
    assert main(["metrics", str(tmp_path / "same.exr"), str(blender_file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mse"] == 0


@pytest.mark.usefixtures("identity")
@pytest.mark.parametrize("method", [[], ["--method", "flr"]])
def test_one_command_gives_picture_alpha_and_light(
    blender_file: Path, tmp_path: Path, method: list[str]
) -> None:
    before, out = blender_file.read_bytes(), tmp_path / "out"
    assert main(["denoise", str(blender_file), "-o", str(out), "--png", *method]) == 0
    source, made = (exr.read_channels(p) for p in (blender_file, out / "render.exr"))
    assert set(made) == {*"RGBA", *(f"indirect.{c}" for c in "RGB" if method)}
    for c in "RGBA":
        np.testing.assert_allclose(made[c], source[f"ViewLayer.Combined.{c}"], rtol=1e-5)
    assert (tmp_path / "out" / "render.png").exists()
    assert blender_file.read_bytes() == before


def test_all_channels_stand_in_for_the_input_and_still_sum_up(
    blender_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that are denoised, of a method of indirect light."""
    half = lambda _, frame: 0.5 * frame.indirect + 1
    monkeypatch.setattr(denoising.Denoiser, "__call__", half)
    out = tmp_path / "out.exr"
    options = ["--channels", "all", "--method", "flr"]
    assert main(["denoise", str(blender_file), "-o", str(out), *options]) == 0
    source, made = exr.read_channels(blender_file), exr.read_channels(out)
    assert set(source) < set(made)
    names = layouts.load(blender_file).layout.channels
    image = {n: np.stack([made[c] for c in names[n]], -1) for n in ("indirect", "direct", "albedo")}
    glossy = np.stack([made[f"ViewLayer.Glossy Direct.{c}"] for c in "RGB"], -1)
    rest = beauty(out) - image["albedo"] * (image["direct"] + image["indirect"]) - glossy
    np.testing.assert_allclose(rest[..., 1], 0.1, atol=1e-3)  # the frame's emission is 0, 0.1, 0
    np.testing.assert_allclose(rest[..., [0, 2]], 0, atol=1e-5)
    for c in "RGB":
        np.testing.assert_array_equal(made[c], made[f"ViewLayer.Combined.{c}"])
    untouched = [n for n in source if not re.search("Combined|Ind", n)]
    assert all(np.array_equal(source[n], made[n]) for n in untouched)


@pytest.fixture(scope="session", params=["4.5.15", "5.0.1"])
def blender(request: pytest.FixtureRequest) -> Path:
    """A Python with Blender as a module, made once (300 MB) in the repository's cache."""
    folder = Path(__file__).parents[2] / "cache" / f"bpy-{request.param}"
    python = folder / "bin" / "python"
    if sys.version_info[:2] != (3, 11):
        pytest.skip("Blender's module of this version needs Python 3.11")
    if not (folder / "installed").exists():
        venv.create(folder, with_pip=True)
        command = [python, "-m", "pip", "install", "--quiet", f"bpy=={request.param}"]
        if subprocess.run(command).returncode:
            pytest.skip("the package bpy cannot be installed here")
        (folder / "installed").touch()
    return python


SCENE = Path(__file__).with_name("blender_scene.py")
ROOT = Path(__file__).parents[2]
EXTENSION = ROOT / "docs" / "examples" / "blender"


def noise(picture: np.ndarray) -> float:
    """How much neighbours differ on the floor, which is lit evenly."""
    return float(np.abs(np.diff(picture[54:, 50:80], axis=1)).mean())


def render(python: Path, *arguments: object) -> None:
    environment = os.environ | {"PYTHONPATH": ""}
    command = [str(a) for a in (python, SCENE, *arguments)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("written", ["all", "denoising", "denoised"])
def test_a_real_render(blender: Path, tmp_path: Path, written: str) -> None:
    path, out = tmp_path / "render.exr", tmp_path / "out.exr"
    render(blender, path, 96, 64, 1, written)
    read = read_frame(path)
    noisy = beauty(path, "ViewLayer.Noisy Image" if written == "denoised" else "ViewLayer.Combined")
    np.testing.assert_allclose(composite(read, read.indirect), noisy, rtol=1e-4, atol=1e-4)
    assert 0.5 < read.mask.mean() < 1
    assert main(["denoise", str(path), "-o", str(out), "--channels", "all"]) == 0
    picture = np.stack([exr.read_channels(out)[c] for c in "RGB"], -1)
    assert np.isfinite(picture).all()
    assert noise(picture) < 0.25 * noise(noisy)


@pytest.mark.slow
def test_what_is_known_of_blenders_passes(blender: Path, tmp_path: Path) -> None:
    """Depth runs along the view axis, normals face the camera, the passes sum to the picture."""
    render(blender, tmp_path / "a.exr", 96, 64, 1, "all")
    read = read_frame(tmp_path / "a.exr")
    eye, axis = np.array([0, -7, 2.5]), np.array([0, np.sin(1.35), -np.cos(1.35)])
    hit = read.depth[..., 0] > 0
    ray = (read.position - eye)[hit]
    np.testing.assert_allclose(read.depth[..., 0][hit], ray @ axis, rtol=1e-4)
    assert ((ray * read.normal[hit]).sum(-1) < 0).all()
    np.testing.assert_allclose(np.linalg.norm(read.normal[hit], axis=-1), 1, atol=1e-3)
    assert (~hit).any() and read.emission.min() > -1e-4


@pytest.mark.slow
def test_motion_leads_to_where_a_point_was(blender: Path, tmp_path: Path) -> None:
    """The cube has come from 0.4 to the left and 0.1 below: in pixels, at its distance."""
    render(blender, tmp_path / "a.exr", 96, 64, 1, "moving")
    read = read_frame(tmp_path / "a.exr")
    cube = read.albedo[..., 1] > 1.5 * read.albedo[..., 0]
    pixels = 48 / np.tan(np.radians(39.6) / 2) / read.depth[cube]
    x, y = (read.motion[cube] / pixels).T
    np.testing.assert_allclose(x, -0.4, atol=0.02)
    np.testing.assert_allclose(y, 0.1 * np.sin(1.35), atol=0.02)


@pytest.mark.slow
def test_the_extension(blender: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Installed from its zip, it gives what the command does, of a frame and of an animation."""
    archive, command = tmp_path / "jflnr_blender.zip", tmp_path / "command"
    files = [EXTENSION / name for name in ("blender_manifest.toml", "__init__.py")]
    subprocess.run([sys.executable, "-m", "zipfile", "-c", archive, *files], check=True)
    command.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m jflnr "$@"\n')
    command.chmod(0o755)
    monkeypatch.setenv("BLENDER_USER_RESOURCES", str(tmp_path / "blender"))
    render(blender, tmp_path, 96, 64, 1, "all", archive, command)

    def pixels(path: Path) -> np.ndarray:
        return np.stack([exr.read_channels(path)[c] for c in "RGB"], -1)

    options = ["--method", "picture", "--quiet"]
    assert main(["denoise", f"{tmp_path}/noisy.exr", "-o", f"{tmp_path}/clean.exr", *options]) == 0
    np.testing.assert_array_equal(np.load(tmp_path / "shown.npy"), pixels(tmp_path / "clean.exr"))
    assert noise(pixels(tmp_path / "clean.exr")) < 0.25 * noise(beauty(tmp_path / "noisy.exr"))
    frames, out = tmp_path / "frames", tmp_path / "out"
    assert main(["denoise", str(frames), "-o", str(out), "--temporal", *options]) == 0
    found = sorted((frames / "jflnr").iterdir())
    assert [path.name for path in found] == ["f_0001.exr", "f_0002.exr"]
    for path in found:
        np.testing.assert_array_equal(pixels(path), pixels(out / path.name))
