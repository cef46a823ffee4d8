"""Training: its optimiser, its examples, going on after an interruption, several devices."""

import dataclasses
import itertools
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr import denoise
from jflnr.network import examples as reading
from jflnr.network import loss, train
from jflnr.network.adam import Adam
from jflnr.network.augment import augment


def test_adam_is_the_papers_algorithm():
    """Algorithm 1 of Kingma and Ba in numpy, on a quadratic."""
    curvature = np.array([1.0, 10.0, 0.1])
    solver = Adam(lambda p, data: jnp.sum(data * p**2) / 2, lambda t: 0.1, clip=1e9)
    params = jnp.ones(3)
    state = solver.init_state(params)
    p, m, v = np.ones(3), 0, 0
    for t in range(1, 6):
        params, state = solver.update(params, state, data=jnp.asarray(curvature))
        g = curvature * p
        m, v = 0.9 * m + 0.1 * g, 0.99 * v + 0.01 * g**2
        p = p - 0.1 * (m / (1 - 0.9**t)) / (np.sqrt(v / (1 - 0.99**t)) + 1e-8)
    np.testing.assert_allclose(params, p, rtol=1e-5)


def test_adam_runs_over_an_iterator_as_jaxopts_solvers_do():
    solver = Adam(lambda p, data: jnp.mean((p - data) ** 2), lambda t: 0.1, maxiter=200)
    batches = iter(np.random.default_rng(0).normal(3, 0.1, (300, 8)).astype(np.float32))
    params, state = solver.run_iterator(jnp.zeros(()), batches)
    assert abs(float(params) - 3) < 0.1
    assert abs(float(state.average) - 3) < 0.5


def test_a_step_whose_gradient_overflows_is_left_out():
    solver = Adam(lambda p, data: data * p, lambda t: 0.1)
    params = jnp.ones(())
    state = solver.init_state(params)
    moved, state = solver.update(params, state, data=jnp.asarray(jnp.inf))
    assert float(moved) == 1


def test_augmented_frames_are_denoised_to_augmented_results(crops):
    """Mirrored or recoloured first, or denoised first: the same."""
    frame = dataclasses.replace(crops[0].frame, indirect=np.float32(crops[0].light[1][0]))
    plain = np.asarray(denoise(frame, "flr-adaptive"))
    images = (frame.indirect, frame.reference, plain)
    variants = [
        tuple(np.flip(image, axes)[..., list(order)] for image in images)
        for axes in ((), (0,), (1,), (0, 1))
        for order in itertools.permutations(range(3))
    ]
    found = set()
    for seed in range(5):
        changed = augment(frame, np.random.default_rng(seed))
        number = next(i for i, v in enumerate(variants) if np.array_equal(v[0], changed.indirect))
        np.testing.assert_array_equal(changed.reference, variants[number][1])
        ours = denoise(changed, "flr-adaptive")
        # The brightness by which channels are judged knows green from blue.
        np.testing.assert_allclose(ours, variants[number][2], rtol=0.1, atol=0.1 * plain.max())
        found.add(number)
    assert len(found) > 1


def test_going_on_gives_the_same_weights(crops, settings, tmp_path):
    whole = train.train(crops, [], settings, stop=lambda step: step >= 4)
    state = tmp_path / "state"
    train.train(crops, [], settings, state_file=state, stop=lambda step: step >= 2)
    rest = train.train(crops, [], settings, state_file=state, stop=lambda step: step >= 4)
    for name, value in whole.params.items():
        np.testing.assert_array_equal(rest.params[name], value)
    assert [entry.step for entry in rest.history] == [0, 2, 4]
    other = dataclasses.replace(settings, seed=1)
    with pytest.raises(ValueError, match="another run"):
        train.train(crops, [], other, state_file=state, stop=lambda step: True)


def test_a_state_that_is_none_is_refused(crops, settings, tmp_path):
    (tmp_path / "state").write_bytes(b"no state")
    with pytest.raises(ValueError, match="not the state of a training run"):
        train.train(crops, [], settings, state_file=tmp_path / "state", stop=lambda step: True)


def test_noise_as_target_has_its_least_loss_at_the_mean(rng):
    """The derivative of the loss with noisy targets vanishes, on average, at the true light."""
    noise = jnp.asarray(rng.exponential(2.0, 200_000))
    slope = jax.grad(lambda x: loss.relative(x * jnp.ones_like(noise), noise))
    assert abs(float(slope(2.0))) < 0.02
    assert float(slope(1.5)) < -0.1 and float(slope(2.5)) > 0.1


def test_frames_that_cannot_be_trained_on(frames):
    from jflnr.frame import read_frame, write_frame

    path = frames / "scene1.exr"
    frame = read_frame(path)
    for change, sentence in (
        ({"reference": None}, "reference or two"),
        ({"ao": None}, "layer ao"),
    ):
        write_frame(path, dataclasses.replace(frame, **change))
        with pytest.raises(ValueError, match=sentence):
            list(reading.read([path], 0))


TWO_DEVICES = """
import sys
import jax
import numpy as np
sys.path.insert(0, {root!r})
from pathlib import Path
from jflnr.network import examples, train
examples.HEIGHT, examples.WIDTH = 32, 64
found = [e for some in examples.read(sorted(Path({folder!r}).glob("*.exr")), 0) for e in some]
settings = train.Settings(widths=(4, 4, 4), batch=2, every=1)
result = train.train(found, [], settings, stop=lambda step: step >= 1)
print(len(jax.local_devices()), result.history[-1].loss)
"""


def test_two_devices_find_the_same_loss(frames, crops, settings):
    one = train.train(crops, [], settings, stop=lambda step: step >= 1)
    code = TWO_DEVICES.format(root=os.getcwd(), folder=str(frames))
    flags = os.environ["XLA_FLAGS"] + " --xla_force_host_platform_device_count=2"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    devices, value = done.stdout.split()
    assert devices == "2"
    np.testing.assert_allclose(float(value), one.history[-1].loss, rtol=1e-4)
