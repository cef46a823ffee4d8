"""A frame in pieces: the result of the whole."""

import dataclasses
import functools

import numpy as np
import pytest

import jflnr
from jflnr.frame import Frame
from jflnr.images.guides import shrink
from jflnr.large import memory
from jflnr.large.pieces import pieces
from jflnr.large.tiled import Planes
from jflnr.methods import method_of

# One unit in the last place of the shift or the scale, which whole and pieces may round apart, is
# magnified by the regression; a seam would be a thousand times larger.
RELATIVE = 1e-5


def room(rng: np.random.Generator, height: int, width: int) -> Frame:
    """Walls with edges between them, a shadow, noise, and some sky."""
    y, x = (grid[..., None].astype(np.float32) for grid in np.mgrid[:height, :width])
    wall = (x // 37 + y // 23) % 3
    normal = np.concatenate([wall == 0, wall == 1, wall == 2], axis=-1).astype(np.float32)
    light = (1 + np.sin(x / 40) * np.cos(y / 31)) * (0.2 + wall) * [1, 0.8, 0.6]
    sky = (x + y) % 97 < 4
    return Frame(
        indirect=(light * rng.exponential(size=light.shape)).astype(np.float32),
        albedo=np.full((height, width, 3), 0.5, np.float32),
        normal=normal,
        depth=np.where(sky, 0, 3 + wall + x / width).astype(np.float32),
        ao=(0.5 + 0.5 * np.cos(x / 11) * rng.uniform(0.8, 1, x.shape)).astype(np.float32),
        mask=np.where(sky, 0, 1).astype(np.float32),
    )


def relative(ours, whole) -> float:
    return float(np.linalg.norm(np.asarray(ours) - whole) / np.linalg.norm(whole))


@pytest.mark.parametrize(
    "size, step, reach, align", [(100, 16, 8, 4), (101, 7, 30, 8), (5, 9, 1, 2)]
)
def test_pieces_cover_the_line_once_and_reach_far_enough(size, step, reach, align):
    found = pieces(size, step, reach, align)
    assert [i for p in found for i in range(p.start, p.stop)] == list(range(size))
    for p in found:
        assert p.low <= max(p.start - reach, 0) and p.high >= min(p.stop + reach, size)
        assert p.low % align == 0 and p.high <= size
    assert len({p.high - p.low for p in found}) <= 2


def test_planes_are_what_was_written(rng, tmp_path):
    image = rng.random((3, 7, 11), np.float32)
    planes = Planes(tmp_path, (3,), (7, 11))
    planes[0:4, :] = image[:, :4]
    planes[4:7, 2:11] = image[:, 4:, 2:]
    np.testing.assert_array_equal(planes[1:6, 3:9], image[:, 1:6, 3:9])
    planes.file.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("height, width, tile", [(203, 61, 40), (97, 130, 64)])
def test_flr_in_strips_is_flr(rng, backend, height, width, tile):
    denoise = functools.partial(jflnr.denoise, room(rng, height, width), backend=backend)
    assert relative(denoise(tile=tile), denoise()) < RELATIVE


def test_options_of_flr_hold_in_strips(rng, backend):
    """Its position is taken about one point, smaller light has its own rows, windows reach far."""
    fine = room(rng, 90, 66)
    coarse = room(rng, 45, 33).indirect
    position = np.concatenate([fine.depth, fine.ao, fine.depth], axis=-1) + 100
    frame = dataclasses.replace(fine, indirect=coarse, position=position)
    method, guides = jflnr.FLR(9, 1e-4, 1e-3, block=4), ("normal", "position")
    denoise = functools.partial(jflnr.denoise, frame, method, guides=guides, backend=backend)
    assert relative(denoise(tile=30), denoise()) < RELATIVE


@pytest.mark.parametrize(
    "method, height, width",
    [
        ("flr-adaptive", 70, 3584),
        ("auto", 70, 3584),
        ("flnr", 45, 3001),
        pytest.param("flnr-small", 83, 2710, marks=pytest.mark.slow),
    ],
)
def test_adaptive_flr_and_flnr_in_tiles_are_themselves(rng, method, height, width):
    """Wide enough for five tiles whose windows end before the next but one, and so bright that
    squares overflow; without light nothing is made of nothing."""
    frame, unit = room(rng, height, width), np.float32(2**120)
    frame = dataclasses.replace(frame, indirect=unit * frame.indirect)
    denoise = functools.partial(jflnr.denoise, method=method)
    whole, ours = denoise(frame) / unit, denoise(frame, tile=600) / unit
    black = dataclasses.replace(frame, indirect=0 * frame.indirect)
    assert not denoise(black, tile=600).any()
    assert relative(ours, whole) < RELATIVE
    # No seam: where strips and tiles meet, nothing differs more than elsewhere.
    assert np.abs(ours - whole).max() < 1e-3 * whole.mean()


def test_smaller_light_in_tiles_is_itself(rng):
    frame = room(rng, 150, 602)
    coarse = shrink(frame.indirect, 4, frame.mask)
    denoise = functools.partial(jflnr.denoise, dataclasses.replace(frame, indirect=coarse))
    options = {"levels": 2, "with_error": True, "keep_energy": True}
    whole = denoise("flr-adaptive", **options)
    for ours, right in zip(denoise("flr-adaptive", tile=120, **options), whole, strict=True):
        assert relative(ours, right) < RELATIVE


def test_a_nan_in_one_strip_stays_there(rng, backend):
    frame = room(rng, 203, 61)
    light = np.array(frame.indirect)
    light[100, 30] = np.nan
    spoilt = jflnr.denoise(dataclasses.replace(frame, indirect=light), tile=40, backend=backend)
    assert np.isfinite(spoilt).all()


def test_a_wrong_tile_is_named(frame):
    with pytest.raises(ValueError, match="tile must be at least 1"):
        jflnr.denoise(frame, tile=0)


@pytest.mark.parametrize(
    "method, backend, message",
    [
        ("bmfr", "jax", "method bmfr does not work in tiles"),
        *(
            (m, "opencl", f"{m} on opencl needs the whole frame in memory: .* jax backend$")
            for m in ("flr-adaptive", "auto", "flnr", "flnr-small")
        ),
    ],
)
def test_what_cannot_be_done_in_pieces_is_named(frame, method, backend, message):
    with pytest.raises(ValueError, match=message):
        jflnr.denoise(frame, method, backend=backend, tile=32)


@pytest.mark.parametrize("text, size", [("4G", 4 << 30), ("1.5GiB", 3 << 29), ("800m", 800 << 20)])
def test_sizes_are_read(text, size):
    assert memory.parse(text) == size


@pytest.mark.parametrize("text", ["", "0G", "0.5", "-1G", "4X", "lots"])
def test_what_is_no_size_is_named(text):
    with pytest.raises(ValueError, match="--memory must be a size such as 4G"):
        memory.parse(text)


@pytest.mark.parametrize(("method", "gigabytes"), [("flr", 4), ("flr-adaptive", 4), ("flnr", 24)])
def test_larger_frames_come_in_smaller_pieces(method, gigabytes):
    gigabyte = 1 << 30
    tile_for = functools.partial(memory.tile_for, at_once=1, method=method_of(method))
    assert tile_for(1080, 1920, 4 * gigabyte) is None
    large = tile_for(8192, 16384, gigabytes * gigabyte)
    larger = tile_for(16384, 32768, gigabytes * gigabyte)
    assert large > larger > 0
    with pytest.raises(
        ValueError, match=r"512M is too little for 16384 x 8192 pixels .*\d[MG] is nee"
    ):
        tile_for(8192, 16384, gigabyte // 2)
    with pytest.raises(ValueError, match="100K is too little"):
        tile_for(8192, 16384, 100 << 10)


def test_more_frames_at_once_leave_less_for_each():
    tile_for = functools.partial(memory.tile_for, 1080, 1920, 2 << 30, method=method_of("flr"))
    assert tile_for(at_once=1) is None and tile_for(at_once=3) > 0
