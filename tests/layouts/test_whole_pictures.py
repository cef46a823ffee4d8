"""Whole pictures, from files that Cycles wrote, through every entry point.

`cutout.exr` is of Blender 4.5, on a transparent film, `blurred.exr` of Blender 5.0, in one part per
pass; both are of 64 x 36 pixels and 4 samples per pixel (`experiments/rendering/blender.py`).
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

import jflnr
from jflnr import exr, layouts, methods
from jflnr.cli import main
from jflnr.frame import Frame, read_frame
from jflnr.methods import default_of, method_of
from jflnr.regression.lobes import split
from jflnr.regression.picture import WholePicture
from tests.layouts.test_faults import picture_of
from tests.layouts.test_pbrt import gbuffer
from tests.layouts.test_rows import mitsuba

FOLDER = Path(__file__).with_name("cycles")
FEW = WholePicture(levels=2)
LOBES = dataclasses.replace(FEW, lobes=True)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`cutout.exr` with few guides, which soon compile."""
    left = exr.read_channels(FOLDER / "cutout.exr")
    left = {
        name: a for name, a in left.items() if ".Position" not in name and "g Normal" not in name
    }
    path = tmp_path_factory.mktemp("cycles") / "cutout.exr"
    exr.write_channels(path, left, others=exr.read_attributes(FOLDER / "cutout.exr").others)
    return path


@pytest.fixture(scope="module")
def cutout(source: Path) -> Frame:
    return read_frame(source)


@pytest.fixture(scope="module")
def clean(cutout: Frame) -> tuple[np.ndarray, np.ndarray]:
    """The picture `(H, W, 4)` and its light passes."""
    return jflnr.denoise(cutout, LOBES)


def radiance(lobes: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """What passes make up together, `(H, W, 3)`."""
    size = lobes.shape[:2]
    return np.sum(lobes.reshape(*size, -1, 2, 3) * colours.reshape(*size, -1, 1, 3), axis=(2, 3))


@pytest.mark.parametrize("name", ["cutout", "blurred"])
def test_the_layers_of_a_file_make_up_its_beauty(name: str) -> None:
    """In half precision; of both generations of names."""
    frame = read_frame(FOLDER / f"{name}.exr")
    assert (frame.alpha is None) == (name == "blurred")
    # A transparent film does not show its environment.
    own = frame.emitted + (frame.environment if frame.alpha is None else 0)
    total = radiance(frame.lobes, frame.lobe_colours) + own
    np.testing.assert_allclose(total, frame.beauty, atol=2e-3 * frame.beauty.max())
    assert frame.lobes.shape == (36, 64, 18) and np.all(frame.samples == 4)
    assert np.all(frame.seen_albedo >= 0) and frame.seen_normal.shape == (36, 64, 3)


def test_without_denoising_data_albedo_is_the_sum_of_the_colours(tmp_path: Path) -> None:
    channels = exr.read_channels(FOLDER / "cutout.exr")
    left = {name: pixels for name, pixels in channels.items() if "Denoising" not in name}
    exr.write_channels(tmp_path / "a.exr", left)
    read = read_frame(tmp_path / "a.exr")
    size = read.beauty.shape[:2]
    colours = read.lobe_colours.reshape(*size, 3, 3).sum(axis=2)
    np.testing.assert_allclose(read.seen_albedo, colours, rtol=1e-6)
    assert read.seen_normal is None


@pytest.mark.parametrize("program", [mitsuba, gbuffer, picture_of])
def test_other_programs_pictures_are_denoised_whole(
    tmp_path: Path, frame: Frame, program: object
) -> None:
    exr.write_channels(tmp_path / "a.exr", program(frame))  # type: ignore[operator]
    read = read_frame(tmp_path / "a.exr")
    assert default_of(read) == "picture"
    channels = exr.read_channels(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.beauty, np.stack([channels[c] for c in "RGB"], axis=-1))
    assert layouts.is_picture(exr.read_attributes(tmp_path / "a.exr").names)


def test_a_surface_without_diffuse_albedo_is_taken_for_white(tmp_path: Path, frame: Frame) -> None:
    channels = picture_of(frame)
    for c in "RGB":
        channels[f"albedo.{c}"][4:8, 5:9] = 0
    exr.write_channels(tmp_path / "a.exr", channels)
    seen = read_frame(tmp_path / "a.exr").seen_albedo
    assert np.all(seen[4:8, 5:9] == 1)
    np.testing.assert_array_equal(seen[8:], frame.albedo[8:])


def test_our_own_frames_are_not(frame: Frame, frame_file: Path) -> None:
    assert default_of(frame) == default_of(read_frame(frame_file)) == "flr"
    assert not layouts.is_picture(exr.read_attributes(frame_file).names)
    with pytest.raises(ValueError, match="there is no beauty"):
        jflnr.denoise(frame, "picture")


def test_a_picture_may_be_mapped_in_our_own_frame(frame: Frame, frame_file: Path) -> None:
    mapped = read_frame(frame_file, layers={"beauty": "direct"})
    np.testing.assert_array_equal(mapped.beauty, frame.direct)


def test_the_filter_follows_the_samples_that_a_file_tells(tmp_path: Path) -> None:
    source, name = FOLDER / "cutout.exr", "cycles.ViewLayer.samples"
    others = exr.read_attributes(source).others
    written: dict[str, Frame] = {}
    for samples in ("1", "4", "many"):
        path = tmp_path / f"{samples}.exr"
        exr.write_channels(path, exr.read_channels(source), others=others | {name: samples})
        written[samples] = read_frame(path)
    assert [frame.samples.mean() for frame in written.values()] == [1, 4, 4]
    written["unknown"] = dataclasses.replace(written["4"], samples=np.zeros((36, 64, 1)))
    surfaces = {n: WholePicture().images(each, ())["surface"] for n, each in written.items()}
    changes = {n: np.mean(np.abs(np.diff(surface, axis=1))) for n, surface in surfaces.items()}
    assert changes["1"] < changes["4"]
    for same in ("many", "unknown"):
        np.testing.assert_allclose(surfaces[same], surfaces["4"], atol=1e-6)
    # Normals of one sample are unit, as those of pixels' centres, which Cycles does not write.
    frame = written["unknown"]
    length = np.linalg.norm(frame.normal, axis=-1, keepdims=True)
    frame = dataclasses.replace(frame, normal=frame.normal / np.where(length > 0, length, 1))
    told = dataclasses.replace(frame, samples=np.ones_like(frame.depth))
    alone, right = (WholePicture().images(each, ())["surface"] for each in (frame, told))
    np.testing.assert_array_equal(alone, right)


@pytest.mark.filterwarnings("error")
def test_picture_and_alpha_come_nearer_to_what_they_would_converge_to(
    cutout: Frame, clean: tuple
) -> None:
    """Against 1024 samples. Nobody is warned that Cycles has no ambient occlusion."""
    channels = exr.read_channels(FOLDER / "cutout_reference.exr")
    reference = np.stack([np.float32(channels[c]) for c in "RGBA"], axis=-1)
    noisy = np.concatenate([cutout.beauty, cutout.alpha], axis=-1)
    assert np.all(np.isfinite(clean[0])) and np.all(clean[0] >= 0) and np.all(clean[0][..., 3] <= 1)
    assert abs(np.mean(clean[0][..., :3]) / np.mean(cutout.beauty) - 1) < 0.08
    shown = [np.clip(image, 0, 1) ** (1 / 2.2) for image in (noisy, clean[0], reference)]
    before, after = (np.mean((x - shown[2]) ** 2, axis=(0, 1)) for x in shown[:2])
    assert np.all(after[:3] < 0.5 * before[:3])
    assert after[3] < before[3]


def test_passes_sum_to_the_picture(cutout: Frame, clean: tuple) -> None:
    picture, passes = clean[0][..., :3], clean[1]
    n = cutout.lobes.shape[-1]
    lobes, colours, own = np.split(passes, [n, n + n // 2], axis=-1)
    total = radiance(lobes, colours) + own[..., :3]  # the film is transparent
    np.testing.assert_allclose(total, picture, atol=1e-5 * picture.max())
    assert np.all(passes >= 0)
    # Each keeps about the light that it had: to as much as edges of colours change it.
    before = cutout.lobes.reshape(36, 64, 3, 2, 3) * cutout.lobe_colours.reshape(36, 64, 3, 1, 3)
    after = lobes.reshape(before.shape) * colours.reshape(36, 64, 3, 1, 3)
    shares = [np.mean(image, axis=(0, 1, 4)) / np.mean(image) for image in (before, after)]
    np.testing.assert_allclose(*shares, atol=0.5)


def test_light_that_no_pass_holds_is_given_to_none(rng: np.random.Generator) -> None:
    """Where passes hold half of the light, what they leave is the other half."""
    passes = np.float32(np.ones((16, 24, 6)) * [1, 1, 1, 0, 0, 0])
    colour = np.full((16, 24, 3), 0.5, np.float32)
    guides = (np.zeros((16, 24, 0), np.float32),)
    light = np.ones((16, 24, 3), np.float32)
    found, left = jax.jit(split)(2 * light, light, passes, (colour, colour), guides, light[..., 0])
    np.testing.assert_allclose(left, light, rtol=1e-3)
    np.testing.assert_allclose(found, 2 * passes, rtol=1e-3, atol=1e-5)


def test_tiles_give_the_whole(cutout: Frame, clean: tuple) -> None:
    tiles = jflnr.denoise(cutout, FEW, tile=24)
    np.testing.assert_allclose(tiles, clean[0], atol=1e-4 * clean[0].max())


def test_the_device_gives_the_same(cutout: Frame, clean: tuple) -> None:
    pytest.importorskip("pyopencl")
    image = jflnr.denoise(cutout, FEW, backend="opencl")
    np.testing.assert_allclose(image, clean[0], atol=2e-3 * clean[0].max())
    out = np.empty_like(image)
    assert jflnr.Denoiser(FEW, backend="opencl")(cutout, out) is out
    np.testing.assert_array_equal(out, image)


@pytest.mark.filterwarnings("error")
def test_the_device_takes_pixels_that_are_not_finite_without_a_word(cutout: Frame) -> None:
    pytest.importorskip("pyopencl")
    layers = {name: np.array(getattr(cutout, name)) for name in ("beauty", "seen_albedo", "alpha")}
    for k, layer in enumerate(layers.values()):
        layer[5 + k, 7], layer[20, 9 + k] = np.nan, np.inf
    frame = dataclasses.replace(cutout, **layers)
    found, right = (jflnr.denoise(frame, FEW, backend=backend) for backend in ("opencl", "jax"))
    assert np.isfinite(right).all()
    np.testing.assert_allclose(found, right, atol=2e-3 * right.max())


@pytest.mark.parametrize(
    ("name", "value"),
    [("emitted", np.nan), ("emitted", np.inf), ("seen_albedo", np.nan), ("alpha", np.nan)],
)
def test_what_is_nowhere_near_a_number_passes_through(
    cutout: Frame, name: str, value: float, backend: str
) -> None:
    """Where so much of a layer is missing that the filter fills nothing in; the passes too."""
    frame = dataclasses.replace(cutout, beauty=cutout.beauty + 0.5, emitted=cutout.emitted + 0.5)
    layer = np.array(getattr(frame, name))
    layer[2:32, 10:50] = value
    frame = dataclasses.replace(frame, **{name: layer})
    picture, passes = jflnr.denoise(frame, LOBES, backend=backend)
    middle = np.s_[14:20, 26:34]
    shown = np.concatenate([frame.beauty, frame.alpha], axis=-1)
    np.testing.assert_array_equal(picture[middle], shown[middle])
    layers = frame.lobes, frame.lobe_colours, frame.emitted, frame.environment
    np.testing.assert_array_equal(passes[middle], np.concatenate(layers, axis=-1)[middle])
    assert np.isfinite(picture[:, 56:]).all() and np.isfinite(passes[:, 56:]).all()


def test_an_infinity_of_one_pixel_says_nothing_of_the_picture(
    cutout: Frame, clean: tuple, backend: str
) -> None:
    emitted = np.array(cutout.emitted)
    emitted[2, 3] = np.inf
    image = jflnr.denoise(dataclasses.replace(cutout, emitted=emitted), FEW, backend=backend)
    np.testing.assert_allclose(image[:, 32:], clean[0][:, 32:], atol=5e-3 * clean[0].max())


def test_the_device_needs_no_jax(source: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyopencl")
    code = "import sys; from jflnr.cli import main; main(); print('jax' in sys.modules)"
    argv = ["denoise", str(source), "-o", str(tmp_path / "out.exr"), "--backend", "opencl"]
    done = subprocess.run([sys.executable, "-c", code, *argv], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False", done


def test_the_first_frame_of_a_shot_is_the_frame_alone(
    cutout: Frame, clean: tuple, backend: str
) -> None:
    still = dataclasses.replace(cutout, motion=np.zeros((36, 64, 2), np.float32))
    denoiser = jflnr.Denoiser(FEW, backend=backend)
    first = denoiser.next(still)
    np.testing.assert_allclose(first, clean[0], atol=2e-3 * clean[0].max())
    assert np.isfinite(denoiser.next(still)).all()


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    home = methods.HOMES["picture"]
    monkeypatch.setitem(methods.HOMES, "picture", (*home[:2], {"levels": 2}))


@pytest.mark.usefixtures("few")
def test_the_command_writes_a_file_that_takes_the_inputs_place(
    source: Path, tmp_path: Path, clean: tuple, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    command = ["denoise", str(source), "-o", str(out), "--channels", "all", "--json"]
    assert main([*command, "--backend", "jax"]) == 0
    (record,) = json.loads(capsys.readouterr().out)
    assert record["method"] == "picture"
    assert all("of the light of its input" in warning for warning in record["warnings"])
    given, made = exr.read_channels(source), exr.read_channels(out)
    assert set(made) == set(given) | set("RGBA")
    view = "ViewLayer.Combined."
    for i, c in enumerate("RGBA"):
        np.testing.assert_allclose(made[c], clean[0][..., i], rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(made[c], made[view + c])
    names = layouts.load(source).layout
    passes = layouts.pass_names(names)
    for name, plane in zip(passes, np.moveaxis(clean[1], -1, 0), strict=True):
        np.testing.assert_allclose(made[name], plane, rtol=1e-4, atol=1e-5)
    for name in set(given) - {*passes, *(view + c for c in "RGBA")}:
        np.testing.assert_array_equal(made[name], given[name])
    again = read_frame(out)
    total = radiance(again.lobes, again.lobe_colours) + again.emitted
    np.testing.assert_allclose(total, again.beauty, atol=1e-5 * again.beauty.max())


def test_info_says_what_is_denoised(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(FOLDER / "blurred.exr")]) == 0
    shown = capsys.readouterr().out
    assert "the whole picture, ViewLayer.Combined" in shown
    assert "seen_albedo (ViewLayer.Denoising Albedo)" in shown
    assert main(["info", str(FOLDER / "cutout.exr"), "--json"]) == 0
    use = json.loads(capsys.readouterr().out)["denoiser"]
    assert use["method"] == "picture" and use["pixels"] > 0


@pytest.mark.parametrize(
    "options", [["--lobes", "--method", "flr"], ["--guides", "depth", "--lobes"]]
)
def test_lobes_are_of_whole_pictures(
    tmp_path: Path, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    assert main(["denoise", str(FOLDER / "cutout.exr"), "-o", str(out), *options]) == 2
    assert "--lobes is for pictures" in capsys.readouterr().err


def test_options_are_those_of_the_method() -> None:
    assert method_of("picture", lobes=True).features[-1] == "lobe_colours"
    with pytest.raises(ValueError, match="has its own features"):
        jflnr.Denoiser("picture", guides=("normal",))
