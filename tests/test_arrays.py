"""Trees in files: what was written, or one sentence; never more than it may unpack to."""

import zipfile
from typing import NamedTuple

import numpy as np
import pytest

from jflnr import arrays


class Pair(NamedTuple):
    mean: np.ndarray
    counts: tuple


TREE = Pair(np.arange(6, dtype=np.float32).reshape(2, 3), (np.int32(4), np.ones((1, 2), bool)))


@pytest.mark.parametrize("compress", [False, True])
def test_a_tree_comes_back(tmp_path, compress):
    arrays.write(tmp_path / "a", {"of": [1, "ü"]}, TREE, compress)
    header, stored = arrays.read(tmp_path / "a", "a tree", 10_000)
    assert header == {"of": [1, "ü"]} and sorted(stored) == ["counts.0", "counts.1", "mean"]
    found = arrays.restore(stored, TREE)
    assert isinstance(found, Pair) and found.counts[1].dtype == bool and found.counts[0] == 4
    np.testing.assert_array_equal(found.mean, TREE.mean)


@pytest.mark.parametrize(
    "other",
    [TREE._replace(mean=np.zeros((3, 2))), TREE._replace(counts=(1,)), {"mean": TREE.mean}],
)
def test_another_tree_is_refused(tmp_path, other):
    arrays.write(tmp_path / "a", {}, TREE)
    with pytest.raises(ValueError, match="array "):
        arrays.restore(arrays.read(tmp_path / "a", "a tree")[1], other)


@pytest.mark.parametrize("largest", [None, 100_000])
def test_no_more_is_unpacked_than_allowed(tmp_path, largest):
    arrays.write(tmp_path / "a", {}, [np.zeros(100_000)], compress=True)
    with pytest.raises(ValueError, match="a: unpacks to too much"):
        arrays.read(tmp_path / "a", "a tree", largest)


def test_what_is_no_tree_is_refused(tmp_path):
    path = tmp_path / "a"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header.npy", "{}")
    with pytest.raises(ValueError, match="a: not a tree"):
        arrays.read(path, "a tree")
    with path.open("wb") as file:
        np.savez(file, mean=TREE.mean)
    with pytest.raises(ValueError, match="a: not a tree"):
        arrays.read(path, "a tree")
    with pytest.raises(ValueError, match="there is no such file"):
        arrays.read(tmp_path / "none", "a tree")
