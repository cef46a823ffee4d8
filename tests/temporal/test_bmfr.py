"""BMFR over time: what accumulates, what is discarded, what TAA may do."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr import denoising
from jflnr.bmfr import pipeline as bmfr
from jflnr.bmfr import taa as bmfr_taa
from tests.temporal.bmfr_shot import STEP, shot

SIZE = (40, 56)


def changed(frame, **layers):
    return dataclasses.replace(frame, **layers)


def plain(frame):
    return changed(frame, albedo=np.ones_like(frame.albedo))


def run(frames, method=bmfr.PAPER):
    """The last history and all images."""
    history, images = bmfr.start(frames[0]), []
    for frame in frames:
        history, image = bmfr.step(history, frame, method)
        images.append(np.asarray(image))
    return history, np.stack(images)


@pytest.fixture(scope="module")
def frames():
    return shot(8, *SIZE)


@pytest.fixture(scope="module")
def result(frames):
    return run(frames)


def test_scan_equals_loop(frames, result):
    scan = jax.jit(lambda *a: jax.lax.scan(bmfr.step, *a))
    stacked = jax.tree.map(lambda *layers: jnp.stack(layers), *frames)
    history, images = scan(bmfr.start(frames[0]), stacked)
    np.testing.assert_allclose(images, result[1], rtol=1e-4, atol=1e-5)
    assert jax.tree.structure(history) == jax.tree.structure(result[0])


def test_constant_light_stays_constant():
    """But for textures, which TAA blurs as they move."""
    frames = [plain(frame) for frame in shot(6, *SIZE, noise=False)]
    for frame, image in zip(frames, run(frames)[1], strict=True):
        # The noise that regularises the fit leaves a trace of itself.
        np.testing.assert_allclose(image, np.broadcast_to(frame.mask, image.shape), atol=0.01)


def test_light_is_the_mean_of_five_samples_then_fades(frames):
    """Without motion, against the recursion of section 3.2."""
    still = [changed(f, **static_layers(frames[0])) for f in frames]
    history, _ = run(still)
    mean = still[0].indirect.astype(np.float64)
    for number, frame in enumerate(still[1:], start=2):
        mean += max(1 / number, 0.2) * (frame.indirect - mean)
    surface = frames[0].mask[..., 0] > 0
    np.testing.assert_allclose(history.light[surface], mean[surface], rtol=1e-4)
    assert (np.asarray(history.samples)[surface] == len(frames)).all()
    assert not np.asarray(history.samples)[~surface].any()


def static_layers(frame):
    names = ("normal", "depth", "position", "mask", "albedo")
    layers = {name: getattr(frame, name) for name in names}
    return layers | {"motion": np.zeros_like(frame.motion)}


def test_moving_light_is_found_again_and_new_places_start_anew(frames, result):
    """What comes in at the left was there for the fewer frames the farther left it is."""
    count = np.asarray(result[0].samples)[..., 0]
    count = np.where(frames[-1].mask[..., 0] > 0, count, len(frames))
    assert (count[:, 0] == 1).all()
    assert (np.diff(count, axis=1) >= 0).all()
    there_before = np.arange(SIZE[1]) > -STEP[0] * (len(frames) - 1)
    assert (count[:, there_before] == len(frames)).all()


def test_another_surface_is_not_taken_over(frames):
    turned = changed(frames[1], normal=-frames[1].normal)
    history, _ = run([frames[0], turned])
    np.testing.assert_array_equal(history.samples, turned.mask)
    np.testing.assert_array_equal(history.light, turned.indirect * turned.mask)


def test_noise_becomes_less_with_time(frames):
    noise = np.random.default_rng(5).exponential(size=(8, *SIZE, 3)).astype(np.float32)
    noisy = [plain(changed(f, indirect=n)) for f, n in zip(frames, noise, strict=True)]
    error = [
        np.abs(image - 1)[frame.mask[..., 0] > 0].mean()
        for image, frame in zip(run(noisy)[1], noisy, strict=True)
    ]
    assert error[-1] < 0.5 * error[0]


def test_lost_samples_and_the_sky_do_no_harm(frames):
    spoiled = []
    for number, frame in enumerate(frames[:4]):
        light, normal = frame.indirect.copy(), frame.normal.copy()
        light[5:8, 3 + number] = np.nan
        light[frame.mask[..., 0] == 0] = np.inf
        normal[20, 20] = np.nan
        motion = np.where(frame.mask > 0, frame.motion, np.nan)
        spoiled.append(changed(frame, indirect=light, normal=normal, motion=motion))
    history, images = run(spoiled)
    assert np.isfinite(images).all()
    assert not images[-1][frames[3].mask[..., 0] == 0].any()
    assert np.isfinite(history.light).all()


@pytest.fixture(scope="module")
def room_and_reference():
    """A corner of the shipped frame, of the layers that `shot` has."""
    frame = jflnr.read_frame(denoising.SHIPPED_FRAME)
    crop = vars(jax.tree.map(lambda layer: layer[: SIZE[0], : SIZE[1]], frame))
    names = ("indirect", "albedo", "normal", "depth", "position", "mask")
    motion = np.zeros((*SIZE, 2), np.float32)
    return jflnr.Frame(**{n: crop[n] for n in names}, motion=motion), crop["reference"]


@pytest.fixture(scope="module")
def room(room_and_reference):
    return room_and_reference[0]


def test_without_position_depth_says_the_same(room_and_reference):
    room, reference = room_and_reference
    with_position, without = (run([frame])[1][0] for frame in (room, changed(room, position=None)))
    error = lambda image: np.mean((image - reference) ** 2)
    assert error(without) == pytest.approx(error(with_position), rel=0.1)
    assert error(without) < 0.1 * error(room.indirect)


def test_denoise_is_the_first_step(room):
    image = jflnr.denoise(room, "bmfr")
    assert image.shape == room.indirect.shape and image.dtype == np.float32
    history = bmfr.start(room)
    np.testing.assert_array_equal(image, bmfr.step(history, room, bmfr.PAPER)[1])


@pytest.mark.parametrize(
    ("layers", "options", "error", "words"),
    [
        ({}, {"guides": ("normal",)}, ValueError, "own features"),
        ({}, {"sigma": 8}, TypeError, "bmfr has no sigma; it has noise"),
        ({}, {"block": 0}, ValueError, "block must be at least 1"),
        ({}, {"tile": 16}, ValueError, "does not work in tiles"),
        ({"indirect": np.ones((40, 56, 6), np.float32)}, {}, ValueError, "3 channels"),
        ({"motion": np.ones((40, 55, 2), np.float32)}, {}, ValueError, "motion is 55 x 40"),
    ],
)
def test_wrong_input_is_named(room, layers, options, error, words):
    with pytest.raises(error, match=words):
        jflnr.denoise(changed(room, **layers), "bmfr", **options)


def test_colours_come_back():
    to, back = np.array(bmfr_taa.YCOCG), np.array(bmfr_taa.RGB)
    np.testing.assert_array_equal(back @ to, np.eye(3))


taa = jax.jit(bmfr_taa.smooth)


def smoothed(picture, before, motion, known=True, share=0.2):
    motion = np.broadcast_to(np.float32(motion), (*picture.shape[:2], 2))
    known = np.broadcast_to(known, (*picture.shape[:2], 1))
    return np.asarray(taa(picture, before, known, motion, share))


def test_taa_keeps_what_does_not_change():
    picture = np.random.default_rng(0).uniform(size=(9, 11, 3)).astype(np.float32)
    np.testing.assert_allclose(smoothed(picture, picture, (0, 0)), picture, atol=1e-6)


def test_taa_follows_the_motion():
    world = np.random.default_rng(0).uniform(size=(9, 15, 3)).astype(np.float32)
    now, before = world[:, 2:13], world[:, :11]
    np.testing.assert_allclose(smoothed(now, before, (2, 0)), now, atol=1e-6)


def test_taa_forgets_what_is_not_around():
    """A past brighter than anything around is brought down to it; outside there is no past."""
    picture = np.random.default_rng(0).uniform(size=(9, 11, 3)).astype(np.float32)
    flat, bright = np.full((9, 11, 3), 0.5, np.float32), np.full((9, 11, 3), 9, np.float32)
    np.testing.assert_allclose(smoothed(flat, bright, (0, 0)), flat, atol=1e-6)
    for motion in ((20, 0), (0, -20), (np.nan, 0)):
        np.testing.assert_allclose(smoothed(picture, bright, motion), picture, atol=1e-6)


def test_taa_leaves_the_sky_out():
    flat = np.full((9, 11, 3), 0.5, np.float32)
    known = np.arange(11)[:, None] < 6
    before = np.where(known, flat, 0)
    np.testing.assert_allclose(smoothed(flat, before, (0.5, 0), known), flat, atol=1e-6)


def test_taa_mixes_in_a_fifth_of_a_new_picture():
    x = np.arange(11, dtype=np.float32)[:, None] * np.ones((9, 1, 3), np.float32)
    past = x + np.float32(0.25)  # within the range of the neighbours
    inner = np.s_[2:-2, 2:-2]
    np.testing.assert_allclose(smoothed(x, past, (0, 0))[inner], (x + 0.2)[inner], rtol=1e-5)
