"""Damaged files of weights and histories: exactly what was written, or one sentence."""

import contextlib
import functools
import io
import resource

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from jflnr import history
from jflnr.methods import method_of
from jflnr.network import weights
from tests.fuzz.test_arrays import long, short

NETWORKS = sorted(path.stem for path in weights.FOLDER.glob("*.npz"))
reuse = [HealthCheck.function_scoped_fixture, *HealthCheck]
DAMAGE = st.one_of(
    st.tuples(st.just("cut"), st.floats(0, 1), st.just(b"")),
    st.tuples(st.just("insert"), st.floats(0, 1), st.binary(min_size=1, max_size=9)),
    st.tuples(st.just("write"), st.floats(0, 1), st.binary(min_size=1, max_size=9)),
    # Headers and the directory at the end are small: aimed at, or they are hardly ever hit.
    st.tuples(st.just("write"), st.floats(0, 0.01), st.binary(min_size=1, max_size=4)),
    st.tuples(st.just("write"), st.floats(0.95, 1), st.binary(min_size=1, max_size=4)),
)


def damaged(content, how, where, what):
    at = int(where * len(content))
    if how == "cut":
        return content[:at]
    rest = at if how == "insert" else at + len(what)
    return content[:at] + what + content[rest:]


# What a file of less than a megabyte may take.
MOST = 512 * 2**20


@contextlib.contextmanager
def little_memory():
    peak = lambda: 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    before = peak()
    yield
    assert peak() - before < MOST


@functools.cache
def shipped(method):
    path = weights.FOLDER / f"{method}.npz"
    read = method_of(method).read
    return path.read_bytes(), weights.load(path, read)[0], read


@little_memory()
def weights_are_whole_or_refused(folder, method, damage):
    content, whole, read = shipped(method)
    path = folder / "weights.npz"
    path.write_bytes(damaged(content, *damage))
    try:
        found, _ = weights.load(path, read)
    except ValueError as error:
        assert str(path) in str(error) and len(str(error)) < 500
    else:
        assert {n: a.shape for n, a in found.items()} == {n: a.shape for n, a in whole.items()}
        assert all(np.isfinite(array).all() for array in found.values())


@pytest.mark.parametrize("method", NETWORKS)
@short(max_examples=40, suppress_health_check=reuse)
@given(damage=DAMAGE)
def test_weights(tmp_path, method, damage):
    weights_are_whole_or_refused(tmp_path, method, damage)


@pytest.mark.slow
@pytest.mark.parametrize("method", NETWORKS)
@long(max_examples=12500, suppress_health_check=reuse)
@given(damage=DAMAGE)
def test_weights_long(tmp_path, method, damage):
    weights_are_whole_or_refused(tmp_path, method, damage)


STATE = {"mean": np.arange(6, dtype=np.float32).reshape(2, 3), "samples": np.ones((2, 1), "f4")}


@functools.cache
def written(folder):
    path = folder / "written"
    history.write(path, STATE, {"options": {}, "last": ["a", 1, 2]})
    return path.read_bytes()


@little_memory()
def history_is_whole_or_refused(folder, damage):
    path = folder / "history"
    path.write_bytes(damaged(written(folder), *damage))
    try:
        state = history.read(path).state(STATE)
    except ValueError as error:
        assert str(path) in str(error) and len(str(error)) < 500
    else:
        assert jax.tree.map(np.shape, state) == jax.tree.map(np.shape, STATE)


@short(max_examples=150, suppress_health_check=reuse)
@given(damage=DAMAGE)
def test_history(tmp_path, damage):
    history_is_whole_or_refused(tmp_path, damage)


@pytest.mark.slow
@long(max_examples=25000, suppress_health_check=reuse)
@given(damage=DAMAGE)
def test_history_long(tmp_path, damage):
    history_is_whole_or_refused(tmp_path, damage)


@short(max_examples=100, suppress_health_check=reuse)
@given(content=st.binary(max_size=300))
def test_a_history_of_anything(tmp_path, content):
    path = tmp_path / "history"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="not a history"):
        history.read(path)


def test_an_array_of_objects_is_not_unpickled(tmp_path):
    buffer = io.BytesIO()
    header = np.frombuffer(b'{"format": "jflnr history", "about": {}}', np.uint8)
    np.savez(buffer, header=header, array0=np.array([print], object))
    path = tmp_path / "history"
    path.write_bytes(buffer.getvalue())
    with pytest.raises(ValueError, match="not a history"):
        history.read(path)
