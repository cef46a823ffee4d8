"""What other people's files do: odd channels, signs, values, and text that nobody vouches for."""

import json
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from jflnr import exr, layouts
from jflnr.cli import main
from jflnr.frame import Frame, composite, read_frame

BACKENDS = ("jax", "opencl")


def picture_of(frame: Frame) -> dict[str, np.ndarray]:
    """Plain R, G, B with the three guides that no frame can do without."""
    images = {"": ("RGB", frame.albedo * frame.indirect), "albedo": ("RGB", frame.albedo)}
    images |= {"normal": ("XYZ", frame.normal), "depth": ("Z", frame.depth)}
    return {
        f"{layer}.{c}" if layer else c: image[..., i].astype(np.float32)
        for layer, (components, image) in images.items()
        for i, c in enumerate(components)
    }


def save(path: Path, channels: dict[str, np.ndarray]) -> Path:
    exr.write_channels(path, channels)
    return path


@pytest.mark.parametrize(
    "names", ["RGBAZ", "rgbaz", ("R", "G", "B", "A", "depth"), ("R", "G", "B", "Z", "roughness")]
)
def test_plain_channels_beside_layers(tmp_path: Path, frame: Frame, names: str) -> None:
    """As Arnold and RenderMan write them."""
    channels = picture_of(frame)
    depth, extra = channels.pop("depth.Z"), np.ones(frame.depth.shape[:2], np.float32)
    images = dict(zip("RGB", (channels.pop(c) for c in "RGB"), strict=True)) | {"Z": depth}
    images["depth"] = depth
    plain = {name: images.get(name, images.get(name.upper(), extra)) for name in names}
    read = read_frame(save(tmp_path / "a.exr", channels | plain))
    np.testing.assert_array_equal(read.depth, frame.depth)
    np.testing.assert_allclose(read.indirect, frame.indirect, rtol=1e-5)
    assert ("A" in names) == ("A" in layouts.load(tmp_path / "a.exr").layout.picture)


def test_what_is_mapped_counts_before_recognition(tmp_path: Path, frame: Frame) -> None:
    renamed = {"albedo": "diffuse.colour", "depth": "far", "normal": "facing"}
    channels = {
        name.replace(exr.layer_of(name), renamed.get(exr.layer_of(name), "")): pixels
        for name, pixels in picture_of(frame).items()
    }
    path = save(tmp_path / "a.exr", channels)
    read = read_frame(path, layers=renamed)
    np.testing.assert_allclose(read.indirect, frame.indirect, rtol=1e-5)
    picture = np.stack([channels[c] for c in "RGB"], axis=-1)
    np.testing.assert_allclose(composite(read, read.indirect), picture, rtol=1e-5)


@pytest.mark.parametrize("native", [False, True])
def test_a_negative_depth_is_a_depth(
    tmp_path: Path, frame: Frame, frame_file: Path, native: bool
) -> None:
    channels = exr.read_channels(frame_file) if native else picture_of(frame)
    right = read_frame(save(tmp_path / "a.exr", channels))
    found = read_frame(save(tmp_path / "b.exr", channels | {"depth.Z": -channels["depth.Z"]}))
    for layer, image in vars(right).items():
        np.testing.assert_array_equal(getattr(found, layer), image, layer)


@pytest.mark.parametrize(
    ("layer", "value", "why"),
    [("depth.Z", 0, "depth"), ("depth.Z", 1e10, "depth"), ("albedo.", 0, "albedo")],
)
def test_nothing_to_denoise_is_said(
    tmp_path: Path, frame: Frame, layer: str, value: float, why: str, capsys: pytest.CaptureFixture
) -> None:
    channels = {
        name: np.full_like(pixels, value) if name.startswith(layer) else pixels
        for name, pixels in picture_of(frame).items()
    }
    path = save(tmp_path / "a.exr", channels)
    assert main(["info", str(path)]) == 0
    shown = capsys.readouterr().out
    # A whole picture can do without albedo.
    assert ("no pixel has a surface" in shown) == (layer == "depth.Z")
    assert main(["denoise", str(path), "-o", str(tmp_path / "b.exr"), "--method", "flr"]) == 0
    said = capsys.readouterr().err
    assert "no pixel has a surface" in said and why in said


def test_info_counts_the_pixels_to_denoise(
    tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture
) -> None:
    channels = picture_of(frame)
    channels["depth.Z"][:3] = 0
    assert main(["info", str(save(tmp_path / "a.exr", channels)), "--json"]) == 0
    use = json.loads(capsys.readouterr().out)["denoiser"]
    assert use["pixels"] == channels["depth.Z"].size - 3 * channels["depth.Z"].shape[1]


@pytest.mark.parametrize(
    ("method", "layer", "told"),
    [
        *(("flr", layer, layer[:-2]) for layer in ("albedo.G", "normal.Z", "depth.Z")),
        ("picture", "albedo.G", "seen_albedo"),
        ("picture", "emission.G", "emitted"),
    ],
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_passes_through(
    tmp_path: Path,
    frame: Frame,
    method: str,
    layer: str,
    told: str,
    value: float,
    backend: str,
    capsys: pytest.CaptureFixture,
) -> None:
    channels = picture_of(frame)
    channels |= {f"emission.{c}": 0 * channels["R"] for c in "RGB" if "emission" in layer}
    channels[layer][4:6, 5:10] = value
    path, out = save(tmp_path / "a.exr", channels), tmp_path / "b.exr"
    command = ["denoise", str(path), "-o", str(out), "--backend", backend, "--method", method]
    assert main(command) == 0
    said = capsys.readouterr().err
    assert f"10 of {told}" in said or (layer, value) == ("depth.Z", np.inf)
    assert "the light of its input" not in said
    for name, pixels in exr.read_channels(out).items():
        assert np.isfinite(pixels).all()
        if name in "RGB":
            np.testing.assert_array_equal(pixels[4:6, 5:10], channels[name][4:6, 5:10])


DEEP = "[" * 50_000


@pytest.mark.parametrize("comments", [DEEP, '{"a":' * 50_000, '{"view": ' + "9" * 5000 + "}"])
def test_comments_that_are_no_header(
    tmp_path: Path, frame: Frame, comments: str, capsys: pytest.CaptureFixture
) -> None:
    path = tmp_path / "a.exr"
    exr.write_channels(path, picture_of(frame), comments)
    assert main(["info", str(path)]) == 0
    assert main(["denoise", str(path), "-o", str(tmp_path / "b.exr"), "--method", "flr"]) == 0
    assert "denoiser" in layouts.load(tmp_path / "b.exr").header


def test_text_that_is_not_utf8(tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture) -> None:
    """Such text never decides whether a picture is read; it is taken as Latin-1."""
    path, out = tmp_path / "a.exr", tmp_path / "b.exr"
    exr.write_channels(path, picture_of(frame), others={"artist": "Jose~", "by": "~~by~~"})
    for text in (b"Jose~", b"~~by~~"):
        path.write_bytes(path.read_bytes().replace(text, text.replace(b"~", b"\xe9")))
    assert main(["info", str(path)]) == 0
    assert main(["denoise", str(path), "-o", str(out), "--method", "flr"]) == 0
    others = exr.read_attributes(out).others
    assert (others["artist"], others["by"]) == ("Joseé", "éébyéé")
    for name, pixels in picture_of(frame).items():
        np.testing.assert_array_equal(exr.read_channels(path)[name], pixels)


def test_names_that_are_not_utf8(tmp_path: Path, frame: Frame) -> None:
    """Of channels and of attributes; each keeps its pixels, whole and in pieces."""
    path, channels = tmp_path / "a.exr", picture_of(frame)
    odd = {"A~.R": channels["R"], "Z~~.X": channels["G"], "zz~": channels["B"]}
    exr.write_channels(path, channels | odd, others={"au~": "x"})
    for name in (*odd, "au~"):
        ended = name.encode() + b"\0"
        path.write_bytes(path.read_bytes().replace(ended, ended.replace(b"~", b"\xe9"), 1))
    found = exr.read_channels(path)
    for name, pixels in (channels | odd).items():
        np.testing.assert_array_equal(found[name.replace("~", "é")], pixels)
    assert exr.read_attributes(path).others["aué"] == "x"
    pytest.importorskip("OpenImageIO")
    from jflnr.large.scanlines import Scanlines

    assert set(Scanlines(path, None, {}).channels) == set(found)


def test_tiles_far_larger_than_the_image_are_refused(tmp_path: Path) -> None:
    """Memory for a tile would be taken before it is known to be damaged."""
    path, tiles = tmp_path / "a.exr", OpenEXR.TileDescription()
    header = {"type": OpenEXR.tiledimage, "tiles": tiles}
    OpenEXR.File(header, {"R": np.zeros((8, 8), np.float32)}).write(str(path))
    tile = struct.pack("<2I", tiles.xSize, tiles.ySize)
    assert path.read_bytes().count(tile) == 1
    path.write_bytes(path.read_bytes().replace(tile, struct.pack("<2I", 32, 6160416)))
    with pytest.raises(ValueError, match="announces tiles of 32 x 6160416 pixels"):
        exr.read_channels(path)
