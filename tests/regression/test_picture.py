"""What must hold of a whole picture that is denoised."""

import jax
import numpy as np
import pytest

import jflnr
from jflnr.images.noisy_guides import holds_light
from jflnr.regression.picture import Picture, WholePicture, denoise_picture, images_of, own_cover

FEW = WholePicture(levels=2)


@jax.jit
def denoised(picture, samples=None):
    return denoise_picture(picture, FEW, samples=samples)


HEIGHT, WIDTH = 26, 34


def layers(rng, **others):
    """A disc before a wall, four samples per pixel."""
    y, x = np.mgrid[:HEIGHT, :WIDTH][..., None] + rng.random((2, HEIGHT, WIDTH, 4))
    disc = (x - 17) ** 2 + (y - 13) ** 2 < 60
    share = np.mean(disc, axis=-1, keepdims=True)
    noise = rng.exponential(size=(HEIGHT, WIDTH, 4))
    albedo = 0.2 + 0.6 * share * [1, 0.5, 0.2]
    light = np.mean(np.where(disc, 2, 0.5) * noise, axis=-1, keepdims=True)
    normal = share * [0, 0, 1.0] + (1 - share) * [1.0, 0, 0]
    made = {"beauty": light * albedo, "albedo": albedo, "normal": normal} | others
    return Picture(**{name: np.float32(layer) for name, layer in made.items()}), share


def test_less_noise_and_about_the_same_light(rng):
    picture, _ = layers(rng)
    result = denoised(picture, 4).beauty
    assert np.std(np.diff(result, axis=1)) < np.std(np.diff(picture.beauty, axis=1)) / 2
    assert abs(np.mean(result) / np.mean(picture.beauty) - 1) < 0.05


def test_scales_with_the_light(rng):
    picture, share = layers(rng)
    lamp = np.float32(share * [1, 2, 3])
    picture = picture._replace(beauty=picture.beauty + lamp, emission=lamp)
    brighter = picture._replace(beauty=64 * picture.beauty, emission=64 * picture.emission)
    once, more = denoised(picture, 4), denoised(brighter, 4)
    np.testing.assert_allclose(more.beauty / 64, once.beauty, rtol=3e-3, atol=1e-4)


def test_a_constant_picture_stays():
    grey = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    result = denoised(Picture(grey, grey, grey), 4)
    np.testing.assert_allclose(result.beauty, grey, rtol=1e-3)


def test_emission_is_no_light_of_a_surface(rng):
    """Light that is emitted alone is filtered as a feature and stays where it is."""
    _, share = layers(rng)
    lamp = np.float32(share * [9, 8, 7])
    picture, _ = layers(rng, beauty=lamp, emission=lamp)
    result = denoised(picture, 4)
    np.testing.assert_allclose(result.beauty, result.emission, atol=1e-5)
    assert np.all(result.emission[0] == 0)
    np.testing.assert_allclose(np.mean(result.emission), np.mean(lamp), rtol=0.05)


@pytest.mark.parametrize("film", [False, True])
def test_light_that_the_albedo_holds_is_taken_from_it(rng, film):
    """Cycles adds emission and environment; on a transparent film they are there all the same."""
    picture, share = layers(rng)
    own = {"emission": np.float32(9 * share), "environment": np.float32(1 - share)}
    own = {name: np.repeat(layer, 3, axis=-1) for name, layer in own.items()}
    plain = picture._replace(alpha=np.float32(share) if film else None, **own)
    added = plain._replace(albedo=plain.albedo + own["emission"] + own["environment"])
    for one, lit in ((plain, False), (added, True)):
        assert holds_light(one.albedo, own["emission"] + own["environment"]) == lit
        reflected = images_of(one, one, np.float32(4), np.float32(1), lit)["surface"]
        np.testing.assert_allclose(reflected, picture.albedo, atol=1e-5)


def test_a_transparent_film_stays_empty_and_alpha_gets_smoother(rng):
    picture, share = layers(rng)
    behind = {name: np.float32(getattr(picture, name) * share) for name in ("beauty", "albedo")}
    picture = picture._replace(alpha=np.float32(share), **behind)
    result = denoised(picture, 4)
    assert np.all(result.beauty[:2] == 0)  # beyond the window
    y, x = np.mgrid[:HEIGHT, :WIDTH][..., None] + rng.random((2, HEIGHT, WIDTH, 2000))
    exact = np.mean((x - 17) ** 2 + (y - 13) ** 2 < 60, axis=-1, keepdims=True)
    assert np.mean((result.alpha - exact) ** 2) < np.mean((share - exact) ** 2)


def test_alpha_keeps_what_its_noise_does_not_explain(rng):
    """Of many samples nearly all, of one nothing, beside an independent sum over each window."""
    filtered, noisy = rng.uniform(0, 1, (2, 9, 12, 1))
    noisy[4, 5] = np.nan
    for samples in (1, 4, 64):
        taken = np.nan_to_num(noisy - filtered)
        noise = filtered * (1 - filtered) / samples**1.25
        expected = np.empty_like(filtered)
        for y, x in np.ndindex(filtered.shape[:2]):
            window = np.s_[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
            square = np.sum(taken[window] ** 2)
            share = max(square - np.sum(noise[window]), 0) / square
            expected[y, x] = np.clip(filtered[y, x] + share * taken[y, x], 0, 1)
        found = own_cover(noisy, filtered, np.full((9, 12, 1), samples))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("missing", [(), ("depth",), ("depth", "position", "seen_normal")])
def test_light_is_never_negative_and_always_finite(rng, missing):
    picture, share = layers(rng)
    others = {"depth": 1 + share, "position": share * [1, 2, 3], "seen_normal": picture.normal}
    picture = picture._replace(**{n: np.float32(x) for n, x in others.items() if n not in missing})
    picture.beauty[7, 8] = np.nan
    picture.beauty[9] = -1
    result = denoised(picture, 4).beauty
    assert np.isfinite(result).all()
    assert np.all(result >= 0)


def test_guides_without_noise_are_left_as_they_are(data):
    frame = jflnr.read_frame(sorted((data / "val").glob("*.exr"))[0])
    beauty = frame.albedo * frame.indirect
    picture = Picture(beauty, np.clip(frame.albedo, 0, 1), frame.normal, depth=frame.depth)
    picture = jax.tree.map(lambda layer: layer[100:164, 100:196], picture)
    for name in ("normal", "albedo", "depth"):
        np.testing.assert_array_equal(getattr(denoised(picture), name), getattr(picture, name))
