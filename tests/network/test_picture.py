"""The network of whole pictures: what must hold whatever it has learned."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.ndimage

import jflnr
from jflnr.network import examples, train
from jflnr.network.flnr import init
from jflnr.network.picture import PictureFLNR, Read
from jflnr.opencl import Context, network
from jflnr.opencl.devices import NoDevice
from jflnr.regression.picture import WholePicture

HEIGHT, WIDTH, WIDTHS = 36, 46, (4, 5)
FEW = {"levels": 2}


def outspoken(seed=0):
    """Random weights that have much to say everywhere."""
    params = init(jax.random.key(seed), WIDTHS, Read)
    random = np.random.default_rng(seed)
    noise = {name: random.normal(0, 0.2, value.shape) for name, value in params.items()}
    return {name: np.float32(value + noise[name]) for name, value in params.items()}


def frame_of(rng, **others):
    """A disc before an empty film, four samples per pixel."""
    y, x = np.mgrid[:HEIGHT, :WIDTH][..., None] + rng.random((2, HEIGHT, WIDTH, 4))
    share = np.mean((x - 23) ** 2 + (y - 18) ** 2 < 150, axis=-1, keepdims=True)
    light = rng.exponential(size=(HEIGHT, WIDTH, 1))
    layers = {
        "beauty": share * light * [0.8, 0.5, 0.3],
        "seen_albedo": share * [0.8, 0.5, 0.3],
        "normal": share * [0, 0, 1],
        "depth": (share > 0) * 2.0,
        "alpha": share,
        "samples": 4 + 0 * share,
    } | others
    layers["indirect"] = layers["beauty"]
    return jflnr.Frame(**{name: np.float32(layer) for name, layer in layers.items()})


@functools.cache
def method(**options):
    return PictureFLNR(params=outspoken(), **FEW, **options)


@pytest.fixture(scope="module")
def corrected():
    frame = frame_of(np.random.default_rng(0))
    return frame, jflnr.denoise(frame, method())


def test_before_training_it_is_the_picture():
    frame = frame_of(np.random.default_rng(0))
    untrained = PictureFLNR(params=init(jax.random.key(0), WIDTHS, Read), **FEW)
    plain = jflnr.denoise(frame, WholePicture(**FEW))
    np.testing.assert_allclose(jflnr.denoise(frame, untrained), plain, rtol=1e-5, atol=1e-6)


def test_nothing_is_made_where_nothing_is(corrected):
    frame, result = corrected
    assert np.isfinite(result).all() and np.all(result >= 0)
    assert np.all(result[:, :4] == 0) and np.any(result[..., :3] > 1.1 * frame.beauty.max() * 0.01)
    black = dataclasses.replace(frame, beauty=0 * frame.beauty)
    assert not jflnr.denoise(black, method())[..., :3].any()


def test_it_scales_with_the_light(corrected):
    frame, result = corrected
    brighter = dataclasses.replace(frame, beauty=64 * frame.beauty)
    found = jflnr.denoise(brighter, method())[..., :3] / 64
    np.testing.assert_allclose(found, result[..., :3], rtol=3e-3, atol=1e-4)


def test_a_pixel_that_is_not_finite_stays_alone(corrected):
    frame, result = corrected
    beauty = frame.beauty.copy()
    beauty[18, 23] = np.inf
    found = jflnr.denoise(dataclasses.replace(frame, beauty=beauty), method())
    assert np.isfinite(found).all()
    far = np.s_[:, :8]
    np.testing.assert_allclose(found[far], result[far], rtol=0.05, atol=1e-3)


def test_in_tiles_it_is_itself(corrected):
    frame, _ = corrected
    whole, error = jflnr.denoise(frame, method(with_error=True))
    tiles, of_tiles = jflnr.denoise(frame, method(with_error=True), tile=32)
    np.testing.assert_allclose(tiles, whole, rtol=2e-3, atol=2e-4)
    np.testing.assert_allclose(of_tiles, error, rtol=2e-3, atol=2e-4)


def test_the_error_of_a_picture_is_told_in_tiles():
    frame = frame_of(np.random.default_rng(0))
    plain = WholePicture(with_error=True, **FEW)
    whole, tiles = jflnr.denoise(frame, plain)[1], jflnr.denoise(frame, plain, tile=32)[1]
    np.testing.assert_allclose(tiles, whole, rtol=2e-3, atol=2e-4)


def test_on_a_device_it_is_itself(corrected):
    frame, result = corrected
    try:
        found, error = jflnr.denoise(frame, method(with_error=True), backend="opencl")
    except NoDevice:
        pytest.skip("no OpenCL device")
    np.testing.assert_allclose(found, result, rtol=1e-3, atol=1e-4)
    told = jflnr.denoise(frame, method(with_error=True))[1]
    np.testing.assert_allclose(error, told, rtol=1e-3, atol=1e-4)


def test_over_time_its_pictures_are_averaged():
    """In JAX and on a device alike, and not as it corrects the frame alone."""
    random = np.random.default_rng(1)
    still = {"motion": np.zeros((HEIGHT, WIDTH, 2)), "alpha": np.ones((HEIGHT, WIDTH, 1))}
    here, there = jflnr.Denoiser(method()), jflnr.Denoiser(method(), backend="opencl")
    for _ in range(3):
        frame = frame_of(random, **still)
        picture = here.next(frame)
        try:
            found = there.next(frame)
        except NoDevice:
            pytest.skip("no OpenCL device")
        np.testing.assert_allclose(found, picture, rtol=2e-3, atol=1e-3)
    alone = jflnr.denoise(frame, method())
    assert np.abs(alone - picture).max() > 0.1


def test_light_passes_sum_to_what_it_makes(corrected):
    """Also where it takes light from a lamp; none is negative."""
    frame, _ = corrected
    lamp = np.float32(0.3 * frame.alpha * (np.arange(WIDTH) < 23)[:, None] * [1, 1, 1])
    passes = {"lobes": np.concatenate([frame.beauty, 0 * frame.beauty], axis=-1)}
    passes |= {"lobe_colours": np.ones_like(frame.beauty), "emitted": lamp}
    passes |= {"beauty": frame.beauty + lamp, "alpha": None}
    picture, told = jflnr.denoise(dataclasses.replace(frame, **passes), method(lobes=True))
    direct, indirect, colour, emitted, environment = np.split(told, 5, axis=-1)
    assert np.all(told >= 0) and np.any(emitted < 0.9 * lamp)
    total = (direct + indirect) * colour + emitted + environment
    np.testing.assert_allclose(total, picture, atol=1e-5 * picture.max())


def test_what_the_network_says_is_done_as_in_plain_numpy():
    random, size = np.random.default_rng(4), (9, 14)
    light, noisy = random.exponential(size=(2, *size, 3))
    own, albedo = 0.3 * light, random.random((*size, 3)) ** 4
    albedo_left = random.uniform(-1, 1, (*size, 3)) * 0.1
    alpha, weight = random.random((2, *size, 1))
    weight *= random.random((*size, 1)) > 0.2
    samples = random.uniform(0.5, 30, (*size, 1))
    said = 2 * random.standard_normal((*size, 7))
    colour = [0.2126, 0.7152, 0.0722]
    bright = [(image @ colour)[..., None] for image in (light, noisy)]
    share = weight * np.minimum(1, (4 * bright[0] + 0.1) / bright[1])
    left = np.where(weight > 0, share * noisy - light, 0)
    kernel = np.outer([1, 2, 1], [1, 2, 1])[..., None] / 16
    blur = lambda image: scipy.ndimage.correlate(image, kernel, mode="nearest")
    near, all_near = (blur(blur(blur(x))) for x in (light * bright[0], bright[0]))
    gains = np.exp(1.5 * np.tanh(said[..., :3] / 1.5))
    shares = np.split(np.tanh(said[..., 3:]), 4, axis=-1)
    texture = 0.7 * light * np.clip(albedo_left / np.maximum(albedo, 0.02), -1, 4)
    offered = left, blur(left), near / (all_near + 1e-3) / np.maximum(samples, 1), texture
    taken = sum(share * image for share, image in zip(shares, offered, strict=True))
    expected = np.maximum((light + 0.02 * alpha) * gains - 0.02 * alpha + taken, 0)
    with jax.enable_x64(True):
        nothing = dict.fromkeys(Read._fields, jnp.zeros((*size, 1)))
        images = {"light": light, "noisy": noisy, "alpha": alpha, "weight": weight}
        images |= {"samples": samples, "own": own, "albedo": albedo, "albedo_left": albedo_left}
        read = Read(**nothing | {name: jnp.asarray(x) for name, x in images.items()})
        np.testing.assert_allclose(read.corrected(jnp.asarray(said)), expected, rtol=1e-9)


@pytest.mark.parametrize("on_cpu", [True, False], ids=["cpu", "gpu_like"])
@pytest.mark.parametrize("size", [(21, 37), (40, 64)])
def test_its_kernels_are_its_twin(size, on_cpu, monkeypatch):
    """Any images, of sizes that nothing divides."""
    try:
        context = Context()
    except NoDevice:
        pytest.skip("no OpenCL device")
    monkeypatch.setattr(context, "on_cpu", on_cpu)
    rng = np.random.default_rng(0)
    channels = {name: 3 for name in (*Read.COLOURS, *Read.DIRECTIONS)}
    images = {n: rng.random((*size, channels.get(n, 1)), np.float32) for n in Read._fields}
    images["samples"] = 1 + 30 * images["samples"]
    images["noisy"] = images["noisy"] * 5
    read = Read(**images)
    right = jax.jit(lambda params, read: read.corrected(train.flnr.said(params, read)))
    found = network.correct_picture(context, outspoken(), read)
    np.testing.assert_allclose(found, right(outspoken(), read), rtol=1e-4, atol=1e-5)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A training picture: two noisy versions of one sample, one of four, and a target."""
    random, layers = np.random.default_rng(2), {}
    for stream, spp in (("1", 1), ("1_b", 1), ("4", 4)):
        frame = frame_of(random)
        images = {"beauty": frame.beauty * spp, "seen_albedo": frame.seen_albedo}
        layers |= {
            f"{name}_{stream}.{c}": image[..., i]
            for name, image in images.items()
            for i, c in enumerate("RGB")
        }
        layers |= {
            f"{name}_{stream}.{c}": frame.normal[..., i]
            for name in ("normal", "seen_normal")
            for i, c in enumerate("XYZ")
        }
        layers |= {
            f"{name}_{stream}.{c}": 0 * frame.normal[..., 0]
            for name in ("emission", "environment")
            for c in "RGB"
        }
        layers[f"alpha_{stream}.A"] = frame.alpha[..., 0]
    layers["depth.Z"] = frame.depth[..., 0]
    layers |= {f"reference.{c}": 0.7 * frame.seen_albedo[..., i] for i, c in enumerate("RGB")}
    path = tmp_path_factory.mktemp("pictures") / "disc_100.exr"
    jflnr.exr.write_channels(path, layers)
    return path


@pytest.fixture(scope="module")
def record(file):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(examples, "CROP", 32)
        return examples.prepared(file, file.parent / "prepared", PictureFLNR(**FEW))


def test_a_record_holds_every_realisation_of_all_layers(file, record):
    """Mixtures take all layers of a pixel from the same stream, means are of as many samples."""
    assert record["spp"][0].tolist() == [1, 1, 1, 1, 2, 4]
    np.testing.assert_array_equal(record["samples"][0, :, 5, 5, 0], [1, 1, 1, 1, 2, 4])
    noisy, exposure = record["noisy"][0], record["exposure"][0]
    light = noisy.astype(np.float64) * exposure[:, None, None, None]
    of_one, of_other, mixture, _, mean, _ = light
    taken = [np.isclose(mixture, a, rtol=2e-2, atol=1e-3).all(-1) for a in (of_one, of_other)]
    assert 0.3 < np.mean(taken[0]) < 1 and (taken[0] | taken[1]).mean() > 0.98
    np.testing.assert_allclose(mean.mean(), (of_one.mean() + of_other.mean()) / 2, rtol=0.1)


def test_training_on_pictures_lowers_the_loss(record, monkeypatch):
    monkeypatch.setattr(examples, "CROP", 32)
    monkeypatch.setattr(train, "WARM_UP", 1)
    settings = train.Settings(PictureFLNR(**FEW), WIDTHS, batch=2, every=40, rate=1e-2)
    history = train.train([record], [], settings, steps=320).history
    assert history[-1].loss < 0.8 * history[1].loss
