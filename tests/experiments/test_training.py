"""Training the paper's own form."""

import json

import numpy as np
import pytest

import jflnr
from experiments import noise, resume
from experiments.__main__ import main
from experiments.data import SHIPPED


def test_noise_comes_from_the_file_where_it_has_it():
    layers = noise.layers(SHIPPED, (1,))
    assert list(layers) == ["indirect_1"]
    np.testing.assert_array_equal(layers["indirect_1"], jflnr.read_frame(SHIPPED, 1).indirect)


@pytest.mark.slow
def test_quick_version(tmp_path, monkeypatch):
    monkeypatch.setattr(resume, "FOLDER", tmp_path / "cache")
    assert main(["run", "training", "--quick", "--out", str(tmp_path)]) == 0
    (measured,) = json.loads((tmp_path / "training.json").read_bytes())
    assert measured["quick"] and len(measured["parts"]) == 3
    assert all(rows for rows in measured["parts"].values())
