"""FLNR in OpenCL against JAX: the network's layers, what it reads, what it says, and the whole."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

import jflnr
from jflnr import flnr as networks
from jflnr.cli import main
from jflnr.network import features, regression, unet
from jflnr.network.weights import shipped
from jflnr.opencl import Context, flnr, network, network_unet
from jflnr.opencl.arguments import to_image, to_layers, to_weight
from jflnr.opencl.network_unet import MARGIN, Maps
from tests.opencl import tolerances
from tests.opencl.conftest import error, in_float64, scene

# 15 x 51 of the finest blocks: the network's own, of two by two, go beyond them on both sides.
SIZE = (57, 203)


def to_maps(context: Context, image: np.ndarray) -> Maps:
    """An image `(h, w, C)` as the network has it, among zeros and, beyond them, NaN."""
    h, w, count = image.shape
    maps = network_unet.new_maps(context, count, h, w)
    values = np.full(maps.values.shape, np.nan, np.float32)
    planes = planes_of(values, maps)
    planes[:] = 0
    planes[1:-1, :, MARGIN : MARGIN + w] = image.transpose(0, 2, 1)
    maps.values.set(values)
    return maps


def planes_of(values: np.ndarray, maps: Maps) -> np.ndarray:
    size = (maps.h + 2) * maps.channels * maps.pitch
    return values[:size].reshape(maps.h + 2, maps.channels, maps.pitch)


def to_image_of(maps: Maps) -> np.ndarray:
    planes = planes_of(maps.values.get(), maps)[1:-1, :, MARGIN : MARGIN + maps.w]
    return planes.transpose(0, 2, 1)


def spoiled_scene(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Target, guides and a mask, with pixels in them that are not finite."""
    target, guides = scene(*size, 5, 3)
    weight = np.random.default_rng(0).uniform(0, 1, size) > 0.2
    weight[:24, :70] = False
    target[30, 31], target[31, 150, 1], guides[32, 33, 1] = np.nan, np.inf, np.nan
    target[:, 120:160] *= 1e-3
    return target, guides, weight


def outspoken(widths: tuple[int, ...]) -> unet.Params:
    """Random weights of a network that has much to say everywhere."""
    params = regression.init(jax.random.key(0), widths)
    for i, name in enumerate(sorted(params)):
        if "head" in name or "bias" in name:
            key = jax.random.fold_in(jax.random.key(1), i)
            params[name] = jax.random.normal(key, params[name].shape)
    return params


@functools.cache
def by_jax() -> Callable[..., Any]:
    def whole(target: Any, guides: Any, weight: Any, params: Any) -> Any:
        known, shift = regression.prepare(target, guides, weight)
        says = regression.heard(params, known.x, known.size)
        model = known.unit * regression.finish(says, known.steered, shift)
        return known.x, model, regression.evaluate(says, known, shift, guides)

    return jax.jit(whole)


@pytest.mark.parametrize("device", ["context", "gpu_like"])
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (9, 24), (13, 47)])
def test_unet(device: str, size: tuple[int, int], request: pytest.FixtureRequest) -> None:
    """Widths that no number of outputs at a time divides, sizes that no vector does."""
    context = request.getfixturevalue(device)
    params = {name: np.asarray(value) for name, value in outspoken((5, 11, 6)).items()}
    x = np.random.default_rng(0).normal(0, 1, (*size, features.COUNT)).astype(np.float32)
    found = network_unet.apply(context, params, to_maps(context, x))
    with jax.enable_x64(True):
        right = unet.apply({k: v.astype(np.float64) for k, v in params.items()}, np.float64(x))
    for mine, theirs in zip(found, right[:1], strict=True):
        assert error(to_image_of(mine), np.asarray(theirs)) < tolerances.NETWORK


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("side", [1, 3])
def test_convolution(context: Context, side: int, stride: int) -> None:
    """From some channels of a map into some of another, whose margin it leaves at zero."""
    random = np.random.default_rng(0)
    kernel = random.normal(0, 1, (side, side, 4, 7)).astype(np.float32)
    bias = random.normal(0, 1, 7).astype(np.float32)
    x = random.normal(0, 1, (15, 50, 6)).astype(np.float32)
    h, w = -(-15 // stride), -(-50 // stride)
    to = network_unet.new_maps(context, 9, h, w)
    to.values.fill(np.nan)
    arrays = {"layer": kernel, "layer_bias": bias}
    network_unet.convolve(
        context, arrays, "layer", to_maps(context, x), first=1, stride=stride, to=to, to_first=2
    )
    right = in_float64(unet.convolve, stride=stride)(x[..., 1:5], kernel, bias)
    planes = planes_of(to.values.get(), to)
    assert np.isnan(planes[:, :2]).all()
    inside = planes[1:-1, 2:, MARGIN : MARGIN + w].transpose(0, 2, 1)
    right = np.where(right > 0, right, 0.1 * right)
    assert error(inside, right) < tolerances.NETWORK
    inside[:] = 0
    assert not planes[:, 2:].any()


@pytest.mark.parametrize("device", ["context", "gpu_like"])
def test_what_it_reads_and_steers(device: str, request: pytest.FixtureRequest) -> None:
    context = request.getfixturevalue(device)
    target, guides, weight = spoiled_scene(SIZE)
    params = outspoken((4, 5, 6))
    x, model, image = by_jax()(target, guides, weight, params)
    images = context.array(to_image(target)), to_layers(context, guides)
    frame = network.prepare(context, *images, to_weight(context, weight))
    assert np.abs(to_image_of(frame.x) - x).max() < tolerances.FEATURES
    planes = network.finish(params, frame)[0].planes.get().transpose(2, 0, 1, 3)
    found = planes.reshape(*planes.shape[:2], -1)[: model[:, :, 0, 0].size, :, : model.shape[3]]
    assert error(found.reshape(model.shape), np.asarray(model)) < tolerances.ADAPTIVE
    found = flnr(target, guides, params, weight=weight, context=context)
    assert error(found, np.asarray(image)) < tolerances.ADAPTIVE


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (9, 13), (64, 8)])
def test_small_frames(context: Context, gpu_like: Context, size: tuple[int, int]) -> None:
    """Vectors and single pixels give the same, wherever a frame ends."""
    target, guides = scene(*size, 5, 3)
    params = outspoken((4, 5, 6))
    found, right = (flnr(target, guides, params, context=c) for c in (context, gpu_like))
    assert error(found, right) < tolerances.ADAPTIVE


def test_energy_is_kept(context: Context) -> None:
    target, guides, weight = spoiled_scene(SIZE)
    params = shipped("flnr-tiny")
    run = functools.partial(flnr, target, guides, params, weight=weight, context=context)
    plain, found = run(), run(keep_energy=True)
    counts = np.isfinite(target).all(2) & weight
    luminance = np.array([0.2126, 0.7152, 0.0722])
    before, after = (np.sum(image[counts] @ luminance) for image in (target, found))
    assert abs(after / before - 1) < 1e-5
    assert error(found, plain * np.sum(found) / np.sum(plain)) < 1e-5


def test_no_light(context: Context) -> None:
    """Nothing is made of nothing, whatever the network says."""
    target, guides = scene(*SIZE, 5, 3)
    for value in (0, np.nan):
        nothing = np.full_like(target, value)
        assert not flnr(nothing, guides, outspoken((4, 5, 6)), context=context).any()


def test_light_whose_squares_overflow(context: Context) -> None:
    target, guides = scene(*SIZE, 5, 3)
    unit, params = np.float32(2**120), shipped("flnr-tiny")
    plain, found = (flnr(u * target, guides, params, context=context) for u in (1, unit))
    assert error(found / unit, plain) < tolerances.ADAPTIVE


def test_result_on_the_device_and_in_half(context: Context, gpu_like: Context) -> None:
    target, guides = (image.astype(np.float16) for image in scene(*SIZE, 5, 3))
    layers = tuple(np.ascontiguousarray(a) for a in np.split(guides, [3, 4], axis=2))
    params = shipped("flnr-tiny")
    runs = [flnr(target, layers, params, context=context) for _ in range(3)]
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()
    there = [context.array(image) for image in (target, guides)]
    found = flnr(*there, params, context=context, on_device=True)
    np.testing.assert_array_equal(found.get(), runs[0])
    out = np.empty(target.shape, np.float16)
    assert flnr(target, layers, params, context=context, out=out) is out
    np.testing.assert_array_equal(out, runs[0].astype(np.float16))
    assert error(flnr(target, layers, params, context=gpu_like), runs[0]) < tolerances.ADAPTIVE


def test_wrong_arguments(context: Context) -> None:
    target, guides = scene(20, 30, 5, 3)
    with pytest.raises(ValueError, match="must have 5 and 3 channels, as in training; got 4 and 3"):
        flnr(target, guides[..., :4], shipped("flnr-tiny"), context=context)


@pytest.mark.parametrize("method", networks.METHODS)
def test_shipped_networks(context: Context, frame: jflnr.Frame, method: str) -> None:
    found = jflnr.denoise(frame, method, backend="opencl")
    right = np.asarray(jflnr.denoise(frame, method))
    assert error(np.asarray(found), right) < tolerances.ADAPTIVE


def test_real_frames(context: Context, data: Path) -> None:
    for path in sorted(data.glob("*/*_0.exr")):
        frame = jflnr.read_frame(path, spp=1)
        found = jflnr.denoise(frame, "flnr-tiny", backend="opencl")
        right = np.asarray(jflnr.denoise(frame, "flnr-tiny"))
        assert error(np.asarray(found), right) < tolerances.ADAPTIVE, path


def test_command_line(
    context: Context, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["denoise", str(frame_file), "-o", str(frame_file.with_name("out.exr"))]
    command += ["--backend", "opencl", "--method", "flnr-tiny"]
    assert main([*command, "--profile"]) == 0
    printed = capsys.readouterr().out
    assert all(kernel in printed for kernel in ("convolve", "finest", "steer", "weighted_moments"))
    assert main([*command, "--overwrite", "--block", "16"]) == 2
    assert "block 8 only; got 16" in capsys.readouterr().err
