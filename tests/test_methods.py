"""A method that nobody has seen before runs wherever the shipped ones do."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jflnr
from jflnr import exr, methods, temporal
from jflnr.cli import main
from jflnr.denoising import backend_for
from jflnr.frame import Frame
from jflnr.images.inputs import plain_images
from jflnr.methods import method_of
from jflnr.opencl import devices
from jflnr.opencl import temporal as on_device
from jflnr.regression.apply import apply
from jflnr.regression.moments import collect
from jflnr.stages import Stage

NONE = jnp.zeros(0)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Means:
    """The mean light of every block, interpolated."""

    name: ClassVar[str] = "means"
    backends: ClassVar[tuple[str, ...]] = ("jax",)
    margin: ClassVar[int] = 0
    images: ClassVar[Any] = staticmethod(plain_images)
    block: int = field(default=8, metadata={"static": True})

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> Means:
        return self

    def known(self, images: dict) -> dict:
        return {}

    def stages(self) -> tuple[Stage, ...]:
        return (
            Stage(means, (("means", self.block),), pixels=True),
            Stage(shown, (("image", 0),), ("means",), pixels=True, reach=self.block),
        )


def means(method: Means, parts: dict, known: dict) -> dict:
    light = parts["target"]
    sums = collect(light, light[..., :0], NONE, method.block, parts["weight"])
    return {"means": sums[1:] / jnp.maximum(sums[:1], 1e-12)}


def shown(method: Means, parts: dict, known: dict) -> dict:
    none = parts["target"][..., :0]
    return {"image": apply(parts["means"][None], none, NONE, method.block)}


@pytest.fixture
def still(monkeypatch: pytest.MonkeyPatch, frame: Frame) -> Frame:
    """A frame in which nothing moves, and `means` among the methods."""
    monkeypatch.setitem(methods.HOMES, "means", (__name__, "Means", {}))
    return dataclasses.replace(frame, motion=np.zeros_like(frame.motion))


def test_it_denoises_whole(still: Frame) -> None:
    """In the middle between four blocks it is the mean of their means."""
    image = jflnr.denoise(still, "means", block=4)
    around = np.mean(still.indirect[8:16, 16:24], axis=(0, 1))
    np.testing.assert_allclose(np.mean(image[11:13, 19:21], axis=(0, 1)), around, rtol=1e-4)


def test_it_works_in_tiles(still: Frame) -> None:
    whole = jflnr.denoise(still, "means")
    np.testing.assert_allclose(jflnr.denoise(still, "means", tile=16), whole, rtol=1e-5)


def test_it_works_over_time(still: Frame) -> None:
    state, image = temporal.step(temporal.start(still), still, "means")
    np.testing.assert_allclose(image, jflnr.denoise(still, "means"), rtol=1e-5)
    other = dataclasses.replace(still, indirect=still.indirect[::-1])
    second = temporal.step(state, other, "means")[1]
    assert np.isfinite(second).all() and np.any(second != image)


@pytest.mark.usefixtures("still")
def test_the_command_line_knows_it(frame_file: Path, tmp_path: Path, frame: Frame) -> None:
    out = tmp_path / "out.exr"
    command = ["denoise", str(frame_file), "-o", str(out), "--method", "means", "--block", "4"]
    assert main(command) == 0
    image = jflnr.denoise(frame, "means", block=4)
    np.testing.assert_allclose(exr.read_channels(out)["indirect.G"], image[..., 1], rtol=1e-5)
    assert jflnr.read_header(out)["denoiser"]["method"] == "means"
    command = ["denoise", str(frame_file), "-o", str(out), "--method", "means", "--overwrite"]
    assert main([*command, "--backend", "opencl"]) == 2


def test_one_method_is_the_default_everywhere(still: Frame) -> None:
    """Whatever is called without a method, by hand or from the command line."""
    from jflnr.cli import parser
    from jflnr.cli.settings import settings_of

    named = method_of()
    assert jflnr.Denoiser().method_for(still) == named
    arguments = parser().parse_args(["denoise", "a.exr", "-o", "b.exr"])
    assert jflnr.Denoiser(**settings_of(arguments)).method_for(still) == named
    image = temporal.step(temporal.start(still), still)[1]
    np.testing.assert_array_equal(image, temporal.step(temporal.start(still), still, named)[1])
    np.testing.assert_array_equal(jflnr.denoise(still), jflnr.denoise(still, named))


def test_it_is_the_default_on_a_device_too(still: Frame) -> None:
    context = device()
    images = [
        on_device.step(on_device.start(still, context=context), still, *method, context=context)[1]
        for method in ((), (method_of(),))
    ]
    np.testing.assert_array_equal(*images)


def device() -> Any:
    from jflnr.opencl import Context, NoDevice

    try:
        return Context()
    except NoDevice as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("backend", ["jax", "opencl"])
def test_the_first_frame_over_time_is_the_frame_alone(still: Frame, backend: str) -> None:
    """Noisy occlusion and far depths are read as the method alone reads them."""
    if backend == "opencl":
        device()
    rng = np.random.default_rng(0)
    ao = rng.random(still.depth.shape, np.float32)
    depth = np.where(rng.random(ao.shape) < 0.1, 60, still.depth).astype(np.float32)
    noisy = dataclasses.replace(still, ao=ao, depth=depth)
    denoiser = jflnr.Denoiser("flr", backend=backend)
    np.testing.assert_allclose(denoiser.next(noisy), denoiser(noisy), rtol=1e-4, atol=1e-4)


def test_a_batch_is_its_images_one_by_one(rng: np.random.Generator) -> None:
    targets, guides = rng.random((2, 16, 24, 3), np.float32), rng.random((2, 16, 24, 2), np.float32)
    both = jax.vmap(jflnr.flr)(targets, guides)
    for image, target, x in zip(both, targets, guides, strict=True):
        np.testing.assert_allclose(image, jflnr.flr(target, x), rtol=1e-4, atol=1e-5)


def test_the_package_lists_what_it_exports() -> None:
    assert {"Denoiser", "FLR", "denoise", "flr", "temporal"} <= set(dir(jflnr))
    assert all(getattr(jflnr, name) is not None for name in dir(jflnr))


def test_auto_takes_a_device_for_what_it_can_do(monkeypatch: pytest.MonkeyPatch) -> None:
    flr = jflnr.FLR()
    monkeypatch.setattr(devices, "all_devices", lambda: ["a device"])
    assert backend_for("auto", flr) == backend_for("auto", None) == "opencl"
    assert backend_for("jax", flr) == "jax"
    assert backend_for("auto", flr, tile=64) == "jax"

    def none() -> list[str]:
        raise devices.NoDevice("none here")

    monkeypatch.setattr(devices, "all_devices", none)
    assert backend_for("auto", flr) == "jax"
    assert backend_for("opencl", flr) == "opencl"
    with pytest.raises(ValueError, match="must be one of jax, opencl, auto; got 'abacus'"):
        backend_for("abacus", flr)


@pytest.mark.parametrize("method", [None, "flr-adaptive", "auto"])
def test_auto_gives_what_its_choice_gives(frame: Frame, method: str | None) -> None:
    denoiser = jflnr.Denoiser(method, backend="auto")
    assert denoiser.backend in jflnr.BACKENDS
    right = jflnr.denoise(frame, method, backend=denoiser.backend)
    np.testing.assert_array_equal(denoiser(frame), right)
