"""A file of weights is either read exactly or refused in one sentence."""

import pickle
import zipfile

import jax
import numpy as np
import pytest

from jflnr.network import weights
from jflnr.network.flnr import init

WIDTHS = (4, 8)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "network.npz"
    weights.save(path, init(jax.random.key(0), WIDTHS), WIDTHS, steps=7)
    return path


def rewrite(file, **changed):
    with np.load(file) as before:
        arrays = {name: before[name] for name in before.files} | changed
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})


def header(text):
    return np.frombuffer(text.encode(), np.uint8)


def test_what_is_saved_is_loaded_in_half_precision(file):
    loaded, about = weights.load(file)
    start = init(jax.random.key(0), WIDTHS)
    assert loaded.keys() == start.keys()
    for name in start:
        np.testing.assert_allclose(loaded[name], start[name], rtol=1e-3, atol=1e-6)
    assert about["steps"] == 7 and about["guides"] == ["normal", "depth", "ao"]


@pytest.mark.parametrize(
    "changed",
    [
        {"stem": None},
        {"another": np.zeros(3, np.float16)},
        {"stem": np.zeros((1, 1, 2, 4), np.float16)},
        {"stem_bias": np.full(4, np.nan, np.float16)},
        {"stem_bias": np.zeros(4)},
        {"stem_bias": np.array(["a", "b", "c", "d"], object)},
        {"header": None},
        {"header": header("{}")},
        {"header": header("[" * 5000)},
        {"header": header('{"format": "jflnr network", "version": 99}')},
        {"header": header('{"a":' * 5000)},
    ],
    ids=lambda changed: str(next(iter(changed))),
)
def test_a_changed_file_is_refused(file, changed):
    rewrite(file, **changed)
    with pytest.raises(ValueError, match=r"network\.npz: "):
        weights.load(file)


IMPOSSIBLE = {
    ("widths", "[4, 8]"): ('"wide"', "[4]", "[0, 4]", "[4, 1e9]", "[true, 4]"),
    ("guides", '["normal", "depth", "ao"]'): ('["x"]', '["normal"]', "null"),
}


@pytest.mark.parametrize("right, value", [(r, v) for r, some in IMPOSSIBLE.items() for v in some])
def test_impossible_widths_and_other_guides_are_refused(file, right, value):
    name, whole = right
    with np.load(file) as before:
        text = before["header"].tobytes().decode()
    assert whole in text
    rewrite(file, header=header(text.replace(whole, value)))
    with pytest.raises(ValueError, match=f"{name} is"):
        weights.load(file)


def test_damaged_bytes_never_pass_unseen(file, rng):
    whole = file.read_bytes()
    intact, _ = weights.load(file)
    for _ in range(60):
        damaged = bytearray(whole[: rng.integers(1, len(whole) + 1)])
        damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
        file.write_bytes(damaged)
        try:
            read, _ = weights.load(file)
        except ValueError as error:
            assert str(file) in str(error)
        else:  # what is damaged is no array: a date, say
            assert all(np.array_equal(read[name], intact[name]) for name in intact)


def test_a_pickle_is_not_run(tmp_path):
    class Trap:
        def __reduce__(self):
            return print, ("run",)

    path = tmp_path / "trap.npz"
    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(ValueError, match="not a file of weights"):
        weights.load(path)


def test_a_file_that_unpacks_to_too_much_is_not_read(tmp_path):
    path = tmp_path / "large.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", bytes(weights.LARGEST + 1))
    with pytest.raises(ValueError, match="unpacks to too much"):
        weights.load(path)


def test_no_file(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        weights.load(tmp_path / "none.npz")


def test_what_ships_may_first_be_asked_for_inside_jit():
    """It is kept for later calls, in which no tracer is of use."""
    weights.shipped.cache_clear()
    jax.jit(lambda x: (x, weights.shipped("flnr-small"))[0])(1.0)
    assert all(np.asarray(array).size for array in weights.shipped("flnr-small").values())
