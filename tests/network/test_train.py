"""Training: its optimiser, its examples, going on after an interruption, several devices."""

import dataclasses
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr import exr
from jflnr.cli import main
from jflnr.network import adam, examples, flnr, train, weights


def test_adam_is_the_papers_algorithm():
    """Algorithm 1 of Kingma and Ba in numpy, with decay of the weights, on a quadratic."""
    curvature = np.array([0.1, 0.2, 0.05])
    state = adam.start(jnp.ones(3))
    p, m, v = np.ones(3), 0, 0
    for t in range(1, 6):
        g = curvature * p
        state = adam.update(state, jnp.asarray(curvature) * state.params, 0.1)
        m, v = 0.9 * m + 0.1 * g, 0.99 * v + 0.01 * g**2
        p = p - 0.1 * (m / (1 - 0.9**t) / (np.sqrt(v / (1 - 0.99**t)) + 1e-8) + 1e-4 * p)
    np.testing.assert_allclose(state.params, p, rtol=1e-5)


def test_a_step_whose_gradient_overflows_is_left_out():
    state = adam.update(adam.start(jnp.zeros(())), jnp.asarray(jnp.inf), 0.1)
    assert float(state.params) == 0


def test_steps_grow_and_then_fall():
    settings = train.Settings()
    rates = [train.rate_at(step, step / 10_000, settings) for step in (0, 199, 5000, 9999)]
    assert rates[0] < 0.01 * settings.rate + train.LEAST_RATE
    np.testing.assert_allclose(rates[1], settings.rate, rtol=0.02)
    np.testing.assert_allclose(rates[2], settings.rate / 2, rtol=0.03)
    np.testing.assert_allclose(rates[3], train.LEAST_RATE, rtol=0.01)


def test_a_record_holds_every_realisation(frames, records):
    """Two streams of one sample: each, a mixture for each, and their mean of two samples."""
    record = records[1]
    assert record["spp"][0].tolist() == [1, 1, 1, 1, 2]
    channels = exr.read_channels(frames[1])
    layers = (np.stack([channels[f"{n}.{c}"] for c in "RGB"], -1) for n in ("indirect_1", "target"))
    noisy, target = (np.float32(layer) for layer in layers)
    ratio = record["noisy"][0, 0] * record["exposure"][0, 0] / record["target"][0]
    np.testing.assert_allclose(ratio, noisy / target, rtol=5e-3, atol=1e-4)
    np.testing.assert_allclose(np.mean(0.5 * record["target"][0], dtype=float), 0.35, rtol=1e-3)
    # The units of light differ, since the means do.
    one, other, mixture = (record["noisy"][0, i] * record["exposure"][0, i] for i in range(3))
    of_one, of_other = (np.isclose(mixture, a, rtol=5e-3, atol=1e-4).all(-1) for a in (one, other))
    assert 0.3 < np.mean(of_one) < 0.7 and (of_one | of_other).all()


def test_prepared_frames_are_made_once(frames, records, tmp_path, monkeypatch):
    monkeypatch.setattr(examples, "_record", None)
    again = examples.prepared(frames[0], tmp_path / "prepared")
    np.testing.assert_array_equal(again["light"], records[0]["light"])


def test_crops_are_the_record_mirrored_and_recoloured(records):
    """What belongs together stays together: the noisy light and the denoised one of a pixel."""
    record = records[0]
    seen = set()
    for seed in range(8):
        example = examples.draw(flnr.DEFAULT, record, np.random.default_rng(seed))
        read = example.read
        assert read.light.shape == (32, 32, 3) and read.mask.all()
        np.testing.assert_allclose(np.linalg.norm(read.normal, axis=-1), 1, rtol=2e-3)
        tint = example.target.mean((0, 1))
        found = np.sort(read.noisy.mean((0, 1)) / tint * tint.mean())
        seen.add(tuple(np.round(found, 4)))
        assert np.isfinite(jax.tree.leaves(example)[0]).all()
    assert len(seen) > 4


def test_training_lowers_the_loss(records, settings, monkeypatch):
    monkeypatch.setattr(train, "WARM_UP", 1)
    settings = dataclasses.replace(settings, every=50, rate=1e-2)
    history = train.train(records, [], settings, steps=1000).history
    assert history[-1].loss < 0.7 * history[1].loss


def test_going_on_gives_the_same_weights(records, settings, tmp_path, monkeypatch):
    whole = train.train(records, [], settings, steps=4)
    state = tmp_path / "state"

    def stop(entry):
        raise KeyboardInterrupt

    half = train.train(records, [], settings, steps=4, state_file=state, report=stop)
    assert half.stopped and half.best.step == 2
    rest = train.train(records, [], settings, steps=4, state_file=state)
    for name, value in whole.params.items():
        np.testing.assert_array_equal(rest.params[name], value)
    assert [entry.step for entry in rest.history] == [0, 2, 2, 4]
    other = dataclasses.replace(settings, seed=1)
    with pytest.raises(ValueError, match="another run"):
        train.train(records, [], other, steps=4, state_file=state)


def test_time_counts_from_the_first_step(records, settings, monkeypatch):
    """The clock here is moved by the updates: by the first one, which compiles, an hour."""
    moves = [1.0, 1.0, 1.0, 3600.0]
    clock = [0.0]
    real = train._update

    def update(*given):
        clock[0] += moves.pop()
        return real(*given)

    compiled = real._cache_size()
    monkeypatch.setattr(train, "_update", update)
    monkeypatch.setattr(train.time, "monotonic", lambda: clock[0])
    assert train.train(records, [], settings, seconds=3).best.step == 3
    assert real._cache_size() <= compiled + 1


def test_a_state_that_is_none_is_refused(records, settings, tmp_path):
    (tmp_path / "state").write_bytes(b"no state")
    with pytest.raises(ValueError, match="not the state of a training run"):
        train.train(records, [], settings, state_file=tmp_path / "state", steps=1)


def test_frames_that_cannot_be_trained_on(frames, tmp_path):
    channels = exr.read_channels(frames[0])
    for gone, sentence in (("indirect", "no noisy layer"), ("reference|target", "layer reference")):
        names = gone.split("|")
        kept = {n: c for n, c in channels.items() if not n.startswith(tuple(names))}
        exr.write_channels(frames[0], kept)
        with pytest.raises(ValueError, match=sentence):
            examples.prepared(frames[0], tmp_path / "prepared")


def test_command(frames, tmp_path, capsys):
    """It writes weights that say where they come from, keeps them, and goes on."""
    out = tmp_path / "w.npz"
    command = ["train", "--data", str(tmp_path), "--val", str(frames[0]), "-o", str(out)]
    command += ["--method", "flnr-small", "--batch", "2", "--every", "1"]
    assert main([*command, "--steps", "1"]) == 0
    assert "dB at 1 spp" in capsys.readouterr().out
    _, header = weights.load(out)
    assert header["frames"] == 2 and header["scenes"] == 2 and header["widths"] == [10, 16, 24, 32]
    assert main([*command, "--steps", "2"]) == 0
    (tmp_path / "w.npz.state").unlink()
    before = out.read_bytes()
    assert main(command) == 0
    assert "kept as it is" in capsys.readouterr().out and out.read_bytes() == before


TWO_DEVICES = """
import sys
import jax
import numpy as np
sys.path.insert(0, {root!r})
from pathlib import Path
from jflnr.network import examples, train
examples.CROP = 32
found = [np.load(path) for path in sorted(Path({folder!r}).glob("*.npy"))]
settings = train.Settings(widths=(4, 4, 4), batch=2, every=1)
result = train.train(found, [], settings, steps=1)
print(len(jax.local_devices()), result.history[-1].loss)
"""


def test_two_devices_find_the_same_loss(records, settings, tmp_path):
    one = train.train(records, [], settings, steps=1)
    code = TWO_DEVICES.format(root=os.getcwd(), folder=str(tmp_path / "prepared"))
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
