"""The step function: a window that slides over the frame that ships, with noise in every frame."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr import temporal
from jflnr.denoising import SHIPPED_FRAME
from jflnr.frame import Frame
from jflnr.regression.flr import FLR
from jflnr.temporal import sequence

HEIGHT, WIDTH = 48, 80
NOISE = np.random.default_rng(0)


@functools.cache
def whole() -> Frame:
    return jflnr.read_frame(SHIPPED_FRAME)


def view(left: int, moved: int, light: float = 1.0) -> Frame:
    """A part of the frame, `moved` pixels to the right of the last one, one sample per pixel."""
    rows, columns = slice(90, 90 + HEIGHT), slice(150 + left, 150 + left + WIDTH)
    frame = jax.tree.map(lambda layer: layer[rows, columns], whole())
    reference = light * np.asarray(frame.reference, np.float32)
    noise = NOISE.gamma(0.2, 5, (HEIGHT, WIDTH, 1)).astype(np.float32)
    motion = np.full((HEIGHT, WIDTH, 2), (moved, 0), np.float32)
    layers = {"indirect": reference * noise, "reference": reference, "motion": motion}
    return dataclasses.replace(frame, **layers)


def run(frames: list[Frame], method: str = "flr-adaptive") -> list[np.ndarray]:
    state, images = temporal.start(frames[0], method), []
    for frame in frames:
        state, image = temporal.step(state, frame, method)
        images.append(np.asarray(image))
    return images


def error(frame: Frame, image: np.ndarray) -> float:
    """Mean squared error of the light, relative to its square."""
    return float(np.mean((image - frame.reference) ** 2) / np.mean(frame.reference**2))


@pytest.fixture(scope="module")
def pan() -> tuple[list[Frame], list[np.ndarray]]:
    frames = [view(2 * i, 2 * (i > 0)) for i in range(10)]
    return frames, run(frames)


def test_the_first_frame_is_denoised_as_by_itself(pan: tuple) -> None:
    frames, images = pan
    alone = temporal.step(temporal.start(frames[5], "flr-adaptive"), frames[5], "flr-adaptive")[1]
    again = jflnr.denoise(frames[5], "flr-adaptive")
    np.testing.assert_allclose(alone, again, rtol=1e-4, atol=1e-5)
    assert 0.5 < error(frames[5], np.asarray(alone)) / error(frames[0], images[0]) < 2


def test_error_falls_under_a_moving_camera(pan: tuple) -> None:
    frames, images = pan
    assert error(frames[-1], images[-1]) < 0.5 * error(frames[0], images[0])


def test_pictures_are_steady_under_a_moving_camera(pan: tuple) -> None:
    """Moved along, adjacent frames differ far less than two that know nothing of each other."""
    frames, images = pan
    alone = [run([frame])[0] for frame in frames[-2:]]

    def flicker(before: np.ndarray, now: np.ndarray) -> float:
        return float(np.mean(np.abs(now[:, :-2] - before[:, 2:])))

    assert flicker(*images[-2:]) < flicker(*alone) / 5


def test_a_switched_light_leaves_no_trail() -> None:
    frames = [view(0, 0, light) for light in [1.0] * 6 + [2.5] * 3]
    images = run(frames)
    shown = [np.mean(image) for image in images]
    assert shown[5] == pytest.approx(np.mean(frames[5].reference), rel=0.1)
    assert shown[8] == pytest.approx(np.mean(frames[8].reference), rel=0.1)


def rolling(number: int) -> Frame:
    """A ball lit from below that rolls on the spot by 25 degrees a frame, one sample per pixel."""
    y, x = (np.mgrid[:HEIGHT, :WIDTH] - np.float32([HEIGHT / 2, WIDTH / 2])[:, None, None]) / 20
    inside = x**2 + y**2 < 0.95
    normal = np.where(
        inside, [x, y, -np.sqrt(np.maximum(1 - x**2 - y**2, 0))], [[[0]], [[0]], [[-1]]]
    )
    place = np.where(inside, normal, [x, y, 0 * x]) + np.float32([0, 0, 4])[:, None, None]
    angle = np.radians(25) * (number > 0)
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    motion = 20 * inside * (np.einsum("ij,jhw->ihw", back, [x, y]) - [x, y])
    light = np.where(inside, 0.1 + np.maximum(normal[1], 0), 0.5)[None].repeat(3, 0)
    noise = np.random.default_rng(number).gamma(0.2, 5, (1, HEIGHT, WIDTH))
    layers = {
        "indirect": light * noise,
        "reference": light,
        "albedo": 0 * light + 1,
        "ao": 0 * light[:1] + 1,
    }
    layers |= {"normal": normal, "position": place, "depth": place[2:], "motion": motion}
    return Frame(**{k: np.float32(np.moveaxis(v, 0, -1)) for k, v in layers.items()})


def test_a_surface_that_turns_is_lit_as_it_faces_now() -> None:
    """With a history it is about as far from the truth as by itself, not fivefold."""
    frames = [rolling(i) for i in range(8)]
    ball = np.asarray(frames[0].normal)[..., 1] != 0
    alone = [np.asarray(jflnr.denoise(frame, "flr-adaptive")) for frame in frames[4:]]
    history = run(frames)[4:]
    errors = [
        np.mean(
            [
                (image - frame.reference)[ball] ** 2
                for image, frame in zip(images, frames[4:], strict=True)
            ]
        )
        for images in (alone, history)
    ]
    assert errors[1] < 1.5 * errors[0]


def test_light_that_follows_the_normals_is_exact_however_these_turn() -> None:
    """The averaged light is that of the averaged guides, so the fit is as exact as in one frame."""
    frames = [rolling(i) for i in range(4)]
    frames = [dataclasses.replace(f, indirect=1 + 0.5 * f.normal[..., 1:2]) for f in frames]
    state, method = temporal.start(frames[0], "flr"), FLR(sigma=3.0, eps_prime=1e-6)
    fits = temporal.Temporal(image=1.0, caution=1e9)  # not averaged, nor is light said to change
    for frame in frames:
        state, image = temporal.step(state, frame, method, temporal=fits)
    assert np.abs(state.guides[..., :3] - frames[-1].normal)[20:28, 30:50].max() > 0.1
    np.testing.assert_allclose(image, frames[-1].indirect, atol=2e-3)


def test_the_unit_of_light_does_not_matter() -> None:
    frames = [view(0, 0) for _ in range(3)]
    bright = [dataclasses.replace(frame, indirect=1024 * frame.indirect) for frame in frames]
    np.testing.assert_allclose(run(bright)[-1], 1024 * run(frames)[-1], rtol=1e-3, atol=1e-2)


def test_nothing_is_compiled_twice() -> None:
    frames = [view(0, 0) for _ in range(3)]
    state, _ = temporal.step(temporal.start(frames[0]), frames[0])
    programs = sequence._step._cache_size()
    for frame in frames[1:]:
        state, _ = temporal.step(state, frame)
    assert sequence._step._cache_size() == programs


def test_scan_is_the_loop_and_can_be_differentiated() -> None:
    """The image scales with the light, so by Euler its derivative along the light is itself."""
    frames = [view(2 * i, 2 * (i > 0)) for i in range(3)]
    together = jax.tree.map(lambda *layers: jnp.stack(layers), *frames)

    @jax.jit
    def scanned(light: jax.Array) -> tuple[jax.Array, jax.Array]:
        def images(light: jax.Array) -> jax.Array:
            inputs = dataclasses.replace(together, indirect=light)
            return jax.lax.scan(step, temporal.start(frames[0]), inputs)[1]

        return jax.jvp(images, (light,), (light,))

    step = functools.partial(temporal.step, method="flr")
    images, derivative = scanned(together.indirect)
    np.testing.assert_allclose(images, run(frames, "flr"), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(derivative, images, rtol=1e-2, atol=1e-3)


def test_holes_are_filled_and_stay_finite() -> None:
    frames = [view(0, 0) for _ in range(3)]
    for frame in frames:
        frame.indirect[10:14, 10:14] = np.nan
    images = run(frames)
    assert np.isfinite(images).all()
    assert np.mean(images[-1][10:14, 10:14]) > 0


def test_errors() -> None:
    frame = view(0, 0)
    state = temporal.start(frame)
    with pytest.raises(ValueError, match="camera_motion finds it"):
        temporal.step(state, dataclasses.replace(frame, motion=None))
    with pytest.raises(ValueError, match="method must be one of flr"):
        temporal.step(state, frame, "svgf")
    with pytest.raises(TypeError, match="flr has no levels"):
        temporal.step(state, frame, levels=3)
    with pytest.raises(ValueError, match="5 channels of guides, and method flr takes 3"):
        temporal.step(state, frame, guides=("normal",))
    with pytest.raises(ValueError, match="another size"):
        temporal.step(state, jax.tree.map(lambda layer: layer[:40], frame))
