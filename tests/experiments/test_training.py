"""What the experiments on training share."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from experiments import noise, resume
from experiments.__main__ import main
from experiments.data import SHIPPED
from experiments.training import shared
from experiments.training.finetune import crops_of
from jflnr.network import examples
from jflnr.network.adam import Adam


def test_descent_counts_its_own_time_and_gives_the_running_mean(monkeypatch):
    """On a bowl, whose minimum is known. data: as `objective` takes it."""
    target = jnp.array([1.0, -2.0])

    def bowl(params, data):
        known, chosen = data
        return jnp.mean(jnp.sum((params["w"] - known.albedo[chosen]) ** 2, axis=-1))

    known = examples.Example(None, None, jnp.stack([target, target, target]), None, None)
    clock = iter(np.arange(0, 1000, 0.5))
    monkeypatch.setattr(shared.time, "process_time", lambda: next(clock))
    solver = Adam(bowl, lambda t: 0.05)
    start = {"w": jnp.zeros(2)}
    found = list(shared.descend(solver, start, known, 2, 100.0))
    seconds, steps, params = found[-1]
    assert found[0] == (0.0, 0, start)
    assert seconds == 100.0 and steps == 200 and len(found) == 16
    np.testing.assert_allclose(params["w"], target, atol=0.5)


def test_noise_comes_from_the_file_where_it_has_it():
    layers = noise.layers(SHIPPED, (1,))
    assert list(layers) == ["indirect_1"]
    np.testing.assert_array_equal(layers["indirect_1"], jflnr.read_frame(SHIPPED, 1).indirect)


def test_crops_to_finetune_on_have_no_reference():
    frame = jflnr.read_frame(SHIPPED)
    light = np.asarray(frame.indirect)
    crops = crops_of(frame, [light, 2 * light])
    assert len(crops) == (225 // examples.HEIGHT) * (400 // examples.WIDTH)
    assert all(crop.frame.reference is None for crop in crops)
    part = np.s_[: examples.HEIGHT, : examples.WIDTH]
    np.testing.assert_array_equal(crops[0].light[1][1], 2 * light[part])


@pytest.mark.slow
def test_quick_version(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", "training", "--quick", "--out", str(tmp_path)]) == 0
    (measured,) = json.loads((tmp_path / "training.json").read_bytes())
    assert measured["quick"] and len(measured["parts"]) == 6
    assert all(rows for rows in measured["parts"].values())
