"""Arrays of another kind, and a program around that has told JAX to be strict."""

import contextlib
import dataclasses

import jax
import numpy as np
import pytest

import jflnr
from jflnr.frame import Frame
from jflnr.large.source import rows_of

SETTINGS = {
    "wide": jax.enable_x64,
    "ranks": lambda on: jax.numpy_rank_promotion("raise" if on else "allow"),
    "types": lambda on: jax.numpy_dtype_promotion("strict" if on else "standard"),
}
METHODS = ("flr", "flr-adaptive", "bmfr")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", [">f4", ">f2", "<f8", ">f8"])
def test_other_arrays(frame: Frame, method: str, backend: str, order: str) -> None:
    half = jax.tree.map(lambda layer: np.asarray(layer, np.float16), frame)
    right = jax.tree.map(lambda layer: layer.astype(order[1:].replace("8", "4")), half)
    other = jax.tree.map(lambda layer: layer.astype(order), half)
    wanted = jflnr.denoise(right, method, backend=backend)
    found = jflnr.denoise(other, method, backend=backend)
    np.testing.assert_array_equal(found, wanted, strict=True)
    assert found.dtype == np.float32


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("strict", [*SETTINGS, "all"])
def test_strict_settings(frame: Frame, method: str, backend: str, strict: str) -> None:
    frame = dataclasses.replace(frame, motion=np.zeros_like(frame.motion))

    def results() -> list[np.ndarray]:
        way = jflnr.Denoiser(method, backend=backend)
        found = [way(frame), way.next(frame), way.next(frame)]
        if method == "flr":  # as the command has it, from file to file
            strips = way.strips(rows_of(frame), ("normal", "depth"), 16)
            found += [parts["image"] for _, parts in strips]
        return found

    wanted = results()
    with contextlib.ExitStack() as stack:
        for name, setting in SETTINGS.items():
            stack.enter_context(setting(strict in (name, "all")))
        found = results()
    for image, right in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(image, right, strict=True)


@pytest.mark.parametrize(
    ("method", "options"),
    [("flr", {"backend": "opencl"}), ("flr", {"tile": 32})],
)
def test_what_jax_cannot_trace_is_one_sentence(frame: Frame, method: str, options: dict) -> None:
    if options.get("backend") == "opencl":
        pytest.importorskip("pyopencl")
    denoise = jflnr.Denoiser(method, **options)
    light = lambda light: denoise(dataclasses.replace(frame, indirect=light)).sum()
    one = jax.numpy.asarray(frame.indirect)
    calls = [lambda: jax.jit(light)(one), lambda: jax.grad(light)(one)]
    for call in (*calls, lambda: jax.vmap(light)(one[None])):
        with pytest.raises(TypeError, match=r"^jax\.jit, jax\.vmap and jax\.grad go through"):
            call()


@pytest.mark.parametrize(
    ("backend", "place", "error", "kind"),
    [
        ("jax", "jflnr.denoising.on_frame", "jax.errors.JaxRuntimeError", MemoryError),
        ("opencl", "jflnr.opencl.twins.regress", "pyopencl.Error", OSError),
    ],
)
def test_a_device_without_room_is_one_sentence(
    frame: Frame, backend: str, place: str, error: str, kind: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, name = error.rsplit(".", 1)
    full = getattr(pytest.importorskip(home), name)

    def fail(*_: object, **__: object) -> None:
        raise full("RESOURCE_EXHAUSTED: Out of memory\n\nmuch more")

    monkeypatch.setattr(place, fail)
    with pytest.raises(kind, match=r"^the .*device .*memory$"):
        jflnr.denoise(frame, "flr", backend=backend)


@pytest.mark.parametrize("method", ["flr", "flr-adaptive", "flnr", "picture", "bmfr"])
def test_a_block_far_beyond_the_frame_is_clamped(frame: Frame, method: str) -> None:
    assert jflnr.Denoiser(method, block=10**9).method_for(frame).block == 64
