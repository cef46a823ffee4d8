"""Frames: the native layout, what is required, and the composite."""

import dataclasses
import re
from pathlib import Path

import jax
import numpy as np
import pytest

from jflnr import exr, layouts
from jflnr.frame import Frame, composite, not_finite, read_frame, read_header, write_frame


def change(path: Path, drop: str = "", add: dict[str, np.ndarray] | None = None) -> None:
    """Rewrite the file at `path` without the channels that match `drop`, with those of `add`."""
    channels = exr.read_channels(path)
    left = {n: pixels for n, pixels in channels.items() if not drop or not re.match(drop, n)}
    exr.write_channels(path, left | (add or {}))


def test_what_is_written_is_read(frame: Frame, frame_file: Path) -> None:
    read = read_frame(frame_file)
    for name in layouts.LAYERS:
        image = getattr(read, name)
        assert image.dtype == np.float32
        np.testing.assert_array_equal(image, getattr(frame, name), err_msg=name)
    assert all(getattr(read, name) is None for name in layouts.PICTURE)
    assert read_header(frame_file) == {"scene": "made up", "view": 0}
    types = {name: pixels.dtype for name, pixels in exr.read_channels(frame_file).items()}
    assert types.pop("depth.Z") == np.float32
    assert set(types.values()) == {np.dtype(np.float16)}


def test_light_too_bright_for_half_is_kept(tmp_path: Path, frame: Frame) -> None:
    bright = dataclasses.replace(frame, indirect=frame.indirect * 1e6)
    write_frame(tmp_path / "a.exr", bright, spp=4)
    np.testing.assert_array_equal(read_frame(tmp_path / "a.exr", spp=4).indirect, bright.indirect)


def test_optional_layers_are_none(tmp_path: Path, frame: Frame) -> None:
    least = Frame(
        indirect=frame.indirect, albedo=frame.albedo, normal=frame.normal, depth=frame.depth
    )
    write_frame(tmp_path / "a.exr", least)
    read = read_frame(tmp_path / "a.exr")
    assert [name for name in layouts.LAYERS if getattr(read, name) is not None] == [
        "indirect",
        "albedo",
        "normal",
        "depth",
    ]


def test_frame_is_a_pytree(frame: Frame) -> None:
    doubled = jax.tree.map(lambda image: 2 * image, dataclasses.replace(frame, motion=None))
    assert doubled.motion is None
    np.testing.assert_array_equal(doubled.depth, 2 * frame.depth)
    total = jax.jit(lambda f: f.albedo.sum())(frame)
    assert np.isclose(total, frame.albedo.sum(), rtol=1e-5)


@pytest.mark.parametrize("layer", ["albedo", "normal", "depth"])
def test_missing_layer_is_named_with_those_present(frame_file: Path, layer: str) -> None:
    change(frame_file, drop=layer)
    with pytest.raises(ValueError, match=rf"layer {layer} is missing; the file holds .*position"):
        read_frame(frame_file)


def test_missing_spp_lists_those_there_are(frame_file: Path) -> None:
    light = {f"indirect_16.{c}": np.ones((24, 40), np.float16) for c in "RGB"}
    change(frame_file, add=light)
    message = "layer indirect_4 is missing; there is indirect light for spp 1, 16"
    with pytest.raises(ValueError, match=message):
        read_frame(frame_file, spp=4)


def test_missing_channel_is_named(frame_file: Path) -> None:
    change(frame_file, drop=r"direct\.G")
    with pytest.raises(ValueError, match=r"layer direct lacks its channel direct\.G"):
        read_frame(frame_file)


def test_layer_without_a_finite_value(frame_file: Path) -> None:
    change(frame_file, add={f"indirect_1.{c}": np.full((24, 40), np.nan, "f") for c in "RGB"})
    with pytest.raises(ValueError, match="layer indirect_1 is NaN or infinite everywhere"):
        read_frame(frame_file)


@pytest.mark.parametrize("spp", [0, -1, 1.0, "1", True])
def test_spp_must_be_a_positive_whole_number(frame_file: Path, spp: object) -> None:
    with pytest.raises((TypeError, ValueError), match="spp must be"):
        read_frame(frame_file, spp=spp)  # type: ignore[arg-type]


def test_header_that_is_no_json_is_empty(tmp_path: Path) -> None:
    for comments in (None, "a remark", "[1]"):
        exr.write_channels(tmp_path / "a.exr", {"R": np.ones((2, 2), "f")}, comments)
        assert read_header(tmp_path / "a.exr") == {}


def test_composite_is_the_rendering_equation(frame: Frame) -> None:
    expected = frame.albedo * (frame.direct + frame.reference) + frame.emission
    np.testing.assert_allclose(composite(frame, frame.reference), expected, rtol=1e-6)


def test_composite_takes_absent_layers_as_black(frame: Frame) -> None:
    bare = dataclasses.replace(frame, direct=None, emission=None)
    np.testing.assert_array_equal(composite(bare, frame.reference), frame.albedo * frame.reference)


def test_composite_checks_its_image(frame: Frame) -> None:
    with pytest.raises(ValueError, match="indirect must have 3 channels"):
        composite(frame, frame.depth)
    with pytest.raises(ValueError, match="albedo is 40 x 24, indirect is 39 x 24"):
        composite(frame, frame.indirect[:, 1:])


def test_pixels_that_are_not_finite_are_counted(frame: Frame) -> None:
    indirect, normal = frame.indirect.copy(), frame.normal.copy()
    indirect[3, 4] = np.nan
    indirect[5, 6, 1] = np.inf
    normal[7, 8, 0] = -np.inf
    broken = dataclasses.replace(frame, indirect=indirect, normal=normal)
    assert not_finite(broken) == {"indirect": 2, "normal": 1}
    assert not_finite(frame) == {}


@pytest.mark.parametrize("name", ["test/bathroom2_0", "val/veach-lamp_0", "train/staircase_0"])
def test_real_frames(data: Path, name: str) -> None:
    path = data / f"{name}.exr"
    frame, header = read_frame(path), read_header(path)
    size = header["height"], header["width"]
    for layer in ("indirect", "albedo", "normal", "depth", "ao", "mask", "direct", "reference"):
        assert getattr(frame, layer).shape[:2] == size, layer
    assert frame.motion is None
    assert np.array(header["camera_to_world"]).shape == (4, 4)
    lengths = np.linalg.norm(frame.normal, axis=-1)[frame.mask[..., 0] > 0]
    np.testing.assert_allclose(lengths, 1, atol=2e-3)
