"""Other names, the user's own word on them, and what comes from the camera."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from jflnr import exr, layouts
from jflnr.cli import main
from jflnr.frame import Frame, composite, read_frame, read_header, write_frame
from jflnr.layouts.source import recognise

USUAL = [
    ("Beauty.{RGB}", "VisibleDiffuse.{RGB}", "OptixNormals.{RGB}", "Z"),
    ("{RGB}", "albedo.{red,green,blue}", "shading_normal.{XYZ}", "depth.V"),
    ("rgba.{RGB}", "diffuse_albedo.{rgb}", "N.{xyz}", "depth.Z"),
    ("main.Composite.{RGB}", "main.Albedo.{RGB}", "main.Normal.{XYZ}", "main.Depth.Y"),
]


def spread(pattern: str) -> list[str]:
    """`a.{RGB}` as a.R, a.G, a.B."""
    stem, brace, rest = pattern.partition("{")
    parts = rest.rstrip("}").split(",") if "," in rest else list(rest.rstrip("}"))
    return [stem + part for part in parts] if brace else [stem]


def write(path: Path, images: dict[str, np.ndarray]) -> None:
    """Write images (H, W, C) under the names that their patterns stand for."""
    channels = {
        name: image[..., i].astype(np.float32)
        for pattern, image in images.items()
        for i, name in enumerate(spread(pattern))
    }
    exr.write_channels(path, channels)


@pytest.mark.parametrize("names", USUAL)
def test_usual_names(tmp_path: Path, frame: Frame, names: tuple[str, ...]) -> None:
    picture = frame.albedo * frame.indirect
    write(
        tmp_path / "a.exr",
        dict(zip(names, (picture, frame.albedo, frame.normal, frame.depth), strict=True)),
    )
    read = read_frame(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.albedo, frame.albedo)
    np.testing.assert_array_equal(read.normal, frame.normal)
    np.testing.assert_array_equal(read.depth, frame.depth)
    np.testing.assert_allclose(read.indirect, frame.indirect, rtol=1e-5)


def test_nothing_known_lists_what_there_is(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", {"gi.{RGB}": np.ones((4, 5, 3))})
    with pytest.raises(ValueError, match=r"indirect_1 is missing; the file holds gi; .* --map"):
        read_frame(tmp_path / "a.exr")


@pytest.fixture
def strange(tmp_path: Path, frame: Frame) -> Path:
    write(
        tmp_path / "a.exr",
        {
            "gi.{RGB}": frame.indirect,
            "paint.{RGBA}": np.concatenate([frame.albedo, frame.ao], -1),
            "facing.{XYZ}": frame.normal,
            "near": frame.depth,
            "open.{RGB}": np.repeat(frame.ao, 3, -1),
        },
    )
    write(tmp_path / "small.exr", {"Y": frame.mask[:5]})
    write(tmp_path / "a_mask.exr", {"Y": frame.mask, "layer.Y": 0 * frame.mask})
    return tmp_path / "a.exr"


MAP = {"indirect": "gi", "albedo": "paint", "normal": "facing.X,facing.Y,facing.Z", "depth": "near"}


def test_map_names_layers_channels_and_files(strange: Path, frame: Frame) -> None:
    """Alpha counts for nothing; three channels give a layer of one by their mean."""
    layers = MAP | {"ao": "open", "mask": "{stem}_mask.exr"}
    read = read_frame(strange, layers=layers)
    for layer in ("indirect", "albedo", "normal", "depth", "ao", "mask"):
        np.testing.assert_allclose(getattr(read, layer), getattr(frame, layer), rtol=1e-6)
    assert (read_frame(strange, layers=layers | {"mask": "a_mask.exr:layer"}).mask == 0).all()


def test_map_from_the_command_line(strange: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = [f"--map={layer}={where}" for layer, where in MAP.items()]
    assert main(["info", str(strange), *options, "--json"]) == 0
    use = json.loads(capsys.readouterr().out)["denoiser"]
    assert use["usable"] and use["channels"]["depth"] == ["near"]


@pytest.mark.parametrize(
    ("layer", "where", "message"),
    [
        ("colour", "gi", "layers must be one of indirect, albedo"),
        ("ao", "gone", "there is no gone for ao; the file holds"),
        ("ao", "gone.exr", "gone.exr: there is no such file"),
        ("mask", "a_mask.exr:gone", "there is no gone for mask"),
        ("mask", "small.exr", "sizes disagree .* is 40 x 24.* is 40 x 5"),
        ("normal", "near,gi.R", "normal is made of 1 or 3 channels, and near,gi.R has 2"),
    ],
)
def test_map_errors(strange: Path, layer: str, where: str, message: str) -> None:
    with pytest.raises((ValueError, OSError), match=message):
        read_frame(strange, layers=MAP | {layer: where})


def test_map_goes_over_what_was_recognised(frame_file: Path, frame: Frame) -> None:
    read = read_frame(frame_file, layers={"indirect": "reference", "ao": "mask"})
    np.testing.assert_array_equal(read.indirect, frame.reference)
    np.testing.assert_array_equal(read.ao, frame.mask)
    np.testing.assert_array_equal(read.emission, frame.emission)


@pytest.mark.parametrize("absent", ["depth", "position"])
@pytest.mark.parametrize("name", ["test/bathroom2_0", "val/dining-room_0"])
def test_depth_and_position_come_from_each_other(
    tmp_path: Path, data: Path, name: str, absent: str
) -> None:
    """Against what the renderer wrote, whose positions are half."""
    path = data / f"{name}.exr"
    truth, channels = read_frame(path), exr.read_channels(path)
    left = {n: pixels for n, pixels in channels.items() if not n.startswith(absent)}
    exr.write_channels(tmp_path / "a.exr", left, json.dumps(read_header(path)))
    derived, expected = getattr(read_frame(tmp_path / "a.exr"), absent), getattr(truth, absent)
    hit = truth.depth[..., 0] > 0
    rounding = 2e-3 * np.abs(truth.position).max()
    np.testing.assert_allclose(derived[hit], expected[hit], atol=rounding)
    assert (derived[~hit] == 0).all()


def test_a_crop_knows_where_it_was(tmp_path: Path, data: Path) -> None:
    path = data / "test" / "bathroom2_0.exr"
    whole = read_frame(path)
    rows, columns = slice(100, 140), slice(300, 360)
    crop = {n: p[rows, columns] for n, p in exr.read_channels(path).items() if n[:4] != "posi"}
    window = exr.Window((300, 100), (0, 0, 639, 359))
    exr.write_channels(tmp_path / "a.exr", crop, json.dumps(read_header(path)), window)
    expected = whole.position[rows, columns]
    derived = read_frame(tmp_path / "a.exr").position
    np.testing.assert_allclose(derived, expected, atol=2e-3 * np.abs(whole.position).max())


def test_without_a_camera_nothing_is_made_up(tmp_path: Path, frame: Frame) -> None:
    write_frame(tmp_path / "a.exr", frame, header={"camera_to_world": "unknown"})
    left = {n: p for n, p in exr.read_channels(tmp_path / "a.exr").items() if n[:5] != "depth"}
    exr.write_channels(tmp_path / "b.exr", left)
    with pytest.raises(ValueError, match="layer depth is missing"):
        read_frame(tmp_path / "b.exr")


def test_ours_is_recognised_first(frame_file: Path) -> None:
    assert layouts.load(frame_file).layout.program == "jflnr"


LAYER_NAMES = st.sampled_from(
    "|V.Combined|V.DiffInd|V.Diffuse Direct|V.DiffCol|V.Normal|V.Depth|V.Vector|V.Emit|V.Position|"
    "V.Denoising Albedo|Combined|Albedo|N|Ns|P|depth|nn|albedo|normal|a.b.albedo|indirect_1|"
    "indirect_x|dd.y|.|emission|beauty|position|ao|mask".split("|")
)
PARTS = st.sampled_from("RGB RGBA XYZ XYZW XY Z T R A I xyz red,green,blue".split())


PROGRAMS = [
    {"V.Combined": "RGBA", "V.DiffCol": "RGB", "V.Normal": "XYZ", "V.Depth": "Z"},
    {"": "RGB", "albedo": "RGB", "nn": "XYZ", "dd.y": "T"},
    {"": "RGB", "Albedo": "RGB", "Ns": "XYZ", "P": "XYZ"},
    {"indirect_1": "RGB", "albedo": "RGB", "normal": "XYZ", "depth": "Z"},
    {"": "R"},
]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PROGRAMS), st.dictionaries(LAYER_NAMES, PARTS, max_size=5))
@example(PROGRAMS[0], {"V.Combined": "A", "V.DiffInd": "RGB"})
def test_any_names_give_a_frame_or_one_sentence(
    program: dict[str, str], others: dict[str, str]
) -> None:
    """Never anything else; and what is written holds the picture where the file had it."""
    names = [
        f"{layer}.{part}" if layer else part
        for layer, parts in (program | others).items()
        for part in (parts.split(",") if "," in parts else parts)
    ]
    noise = np.random.default_rng(0).uniform(0.1, 1, (len(names), 4, 5)).astype(np.float32)
    channels = dict(zip(names, noise, strict=True))
    attributes = exr.Attributes("", "ZIP", 1, exr.Window(), {}, (4, 5))
    source = layouts.Source(Path("a.exr"), channels, attributes, recognise(channels))
    try:
        images = layouts.assemble(source)
    except ValueError as error:
        assert str(error).startswith("a.exr: layer ") and "\n" not in str(error)
        return
    frame = Frame(**images)  # type: ignore[arg-type]
    picture = composite(frame, frame.indirect)
    written = layouts.output_channels(source, picture, None, frame.mask, choice="all")
    beauty = source.layout.channels.get("beauty", ())
    for name in beauty:
        np.testing.assert_allclose(written[name], channels[name], rtol=1e-4, atol=1e-5)
    assert set(channels) <= set(written)
