"""FLNR in OpenCL against JAX: the network's layers, what it corrects, and the whole."""

import functools
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

import jflnr
from jflnr.cli import main
from jflnr.network import flnr as twin
from jflnr.network import unet
from jflnr.network.flnr import FLNR, init
from jflnr.opencl import Context, network
from jflnr.opencl.adaptive import write_light
from jflnr.opencl.arguments import to_image, to_layers, to_weight
from jflnr.opencl.flnr import flnr
from jflnr.opencl.network import MARGIN, Maps
from tests.opencl import tolerances
from tests.opencl.conftest import error, in_float64, scene

# 15 x 51 of the finest blocks: the network's coarsest reach beyond them on both sides.
SIZE = (57, 203)
WIDTHS = (4, 5, 6)


def to_maps(context: Context, image: np.ndarray) -> Maps:
    """An image `(h, w, C)` as the network has it, among zeros and, beyond them, NaN."""
    h, w, count = image.shape
    maps = network.new_maps(context, count, h, w)
    values = np.full(maps.values.shape, np.nan, np.float32)
    planes = planes_of(values, maps)
    planes[:] = 0
    planes[1:-1, :, MARGIN : MARGIN + w] = image.transpose(0, 2, 1)
    maps.values.set(values)
    return maps


def planes_of(values: np.ndarray, maps: Maps) -> np.ndarray:
    size = (maps.h + 2) * maps.channels * maps.pitch
    return values[:size].reshape(maps.h + 2, maps.channels, maps.pitch)


def spoiled_scene(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Target, guides and a mask, with pixels in them that are not finite."""
    target, guides = real_scene(*size)
    weight = np.random.default_rng(0).uniform(0, 1, size) > 0.2
    weight[:24, :70] = False
    target[30, 31], target[31, 150, 1], guides[32, 33, 1] = np.nan, np.inf, np.nan
    target[:, 120:160] *= 1e-3
    return target, guides, weight


def real_scene(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """A scene whose last two guides are as depth and occlusion are."""
    target, guides = scene(height, width, 5, 3)
    guides[..., 3:] = np.clip(np.abs(guides[..., 3:]), 0.05, 1)
    return target, guides


def outspoken(widths: tuple[int, ...] = WIDTHS) -> unet.Params:
    """Random weights of a network that has much to say everywhere."""
    params = init(jax.random.key(0), widths)
    for i, name in enumerate(sorted(params)):
        if "head" in name or "bias" in name:
            key = jax.random.fold_in(jax.random.key(1), i)
            params[name] = 0.3 * jax.random.normal(key, params[name].shape)
    return params


@functools.cache
def by_jax() -> Any:
    def whole(target: Any, guides: Any, weight: Any, params: Any) -> Any:
        return twin.flnr(target, guides, params=params, weight=weight, with_error=True)

    return jax.jit(whole)


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("side", [1, 3])
def test_convolution(context: Context, side: int, stride: int) -> None:
    """Into some channels of a map, whose margin it leaves at zero."""
    random = np.random.default_rng(0)
    kernel = random.normal(0, 1, (side, side, 4, 7)).astype(np.float32)
    bias = random.normal(0, 1, 7).astype(np.float32)
    x = random.normal(0, 1, (15, 50, 4)).astype(np.float32)
    h, w = -(-15 // stride), -(-50 // stride)
    to = network.new_maps(context, 9, h, w)
    to.values.fill(np.nan)
    arrays = {"layer": kernel, "layer_bias": bias}
    network.convolve(context, arrays, "layer", to_maps(context, x), stride=stride, to=to)
    right = in_float64(unet.convolve, stride=stride)(x, kernel, bias)
    planes = planes_of(to.values.get(), to)
    assert np.isnan(planes[:, 7:]).all()
    inside = planes[1:-1, :7, MARGIN : MARGIN + w].transpose(0, 2, 1)
    right = np.where(right > 0, right, 0.1 * right)
    assert error(inside, right) < tolerances.NETWORK
    inside[:] = 0
    assert not planes[:, :7].any()


@pytest.mark.parametrize("device", ["context", "gpu_like"])
@pytest.mark.parametrize(("size", "groups", "guides"), [((70, 90), 1, 5), ((33, 50), 2, 4)])
def test_what_it_corrects(
    device: str,
    size: tuple[int, int],
    groups: int,
    guides: int,
    request: pytest.FixtureRequest,
) -> None:
    """Any light under any error: pixels that do not count, sizes that nothing divides, groups."""
    context, random = request.getfixturevalue(device), np.random.default_rng(0)
    _, layers = real_scene(*size)
    shape = *size, 3 * groups
    target, light = random.exponential(size=(2, *shape)).astype(np.float32)
    target[5, 5], target[3, 4, 0] = 1e30, np.nan
    wrong = random.exponential(size=(*size, 1)).astype(np.float32)
    weight = random.uniform(size=size) > 0.2 if groups == 1 else None
    parts = {"target": target, "guides": layers[..., :guides], "weight": weight}
    parts |= {"fitted": light, "noise": wrong}
    params, mean = outspoken((4, 5, 6, 7)), np.float32(1.7)
    known = {"mean": mean, "unit": np.float32(1)}
    right = jax.jit(twin.correct)(FLNR(params=params), parts, known)["image"]
    read = to_layers(context, parts["guides"])
    images = context.array(target), read, to_weight(context, weight), read
    of_light = (context.array(array) for array in (light, wrong, np.array([mean, 0], np.float32)))
    output = context.empty(shape)
    network.correct(context, params, images, *of_light, output)
    assert error(output.get(), np.asarray(right)) < tolerances.NETWORK_WHOLE


def test_whole(context: Context) -> None:
    target, guides, weight = spoiled_scene(SIZE)
    params = outspoken()
    right, right_error = by_jax()(target, guides, weight, params)
    found = flnr(target, guides, params=params, weight=weight, context=context)
    assert error(found, np.asarray(right)) < tolerances.ADAPTIVE
    layers = to_layers(context, guides)
    images = context.array(to_image(target)), layers, to_weight(context, weight), layers
    light, wrong = context.empty(target.shape), context.empty((*SIZE, 1))
    write_light(context, images, FLNR(), light, wrong)
    assert error(wrong.get(), np.asarray(right_error)) < tolerances.ADAPTIVE


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (9, 13), (64, 8)])
def test_small_frames(context: Context, gpu_like: Context, size: tuple[int, int]) -> None:
    """Vectors and single pixels give the same, wherever a frame ends."""
    target, guides = real_scene(*size)
    params = outspoken()
    found, right = (flnr(target, guides, params=params, context=c) for c in (context, gpu_like))
    assert error(found, right) < tolerances.ADAPTIVE


def test_energy_is_kept(context: Context) -> None:
    target, guides, weight = spoiled_scene(SIZE)
    run = functools.partial(
        flnr, target, guides, params=outspoken(), weight=weight, context=context
    )
    plain, found = run(), run(keep_energy=True)
    counts = np.isfinite(target).all(2) & weight
    luminance = np.array([0.2126, 0.7152, 0.0722])
    before, nearly, after = (np.sum(image[counts] @ luminance) for image in (target, plain, found))
    assert abs(after / before - 1) < 1e-5
    assert abs(nearly / before - 1) < FLNR.slack + 1e-5
    assert error(found, plain * np.sum(found) / np.sum(plain)) < 1e-5


def test_no_light(context: Context) -> None:
    """Nothing is made of nothing, whatever the network says."""
    target, guides = real_scene(*SIZE)
    for value in (0, np.nan):
        nothing = np.full_like(target, value)
        assert not flnr(nothing, guides, params=outspoken(), context=context).any()


def test_light_whose_squares_overflow(context: Context) -> None:
    target, guides = real_scene(*SIZE)
    unit, params = np.float32(2**120), outspoken()
    plain, found = (flnr(u * target, guides, params=params, context=context) for u in (1, unit))
    assert error(found / unit, plain) < tolerances.ADAPTIVE


def test_result_on_the_device_and_in_half(context: Context, gpu_like: Context) -> None:
    target, guides = (image.astype(np.float16) for image in real_scene(*SIZE))
    layers = tuple(np.ascontiguousarray(a) for a in np.split(guides, [3, 4], axis=2))
    params = outspoken()
    runs = [flnr(target, layers, params=params, context=context) for _ in range(3)]
    assert runs[0].tobytes() == runs[1].tobytes() == runs[2].tobytes()
    there = [context.array(image) for image in (target, guides)]
    found = flnr(*there, params=params, context=context, on_device=True)
    np.testing.assert_array_equal(found.get(), runs[0])
    out = np.empty(target.shape, np.float16)
    assert flnr(target, layers, params=params, context=context, out=out) is out
    np.testing.assert_array_equal(out, runs[0].astype(np.float16))
    found = flnr(target, layers, params=params, context=gpu_like)
    assert error(found, runs[0]) < tolerances.ADAPTIVE


def test_wrong_arguments(context: Context) -> None:
    target, guides = real_scene(20, 30)
    with pytest.raises(ValueError, match=r"needs 4 or 5 channels of guides.*; got 3 and 3"):
        flnr(target, guides[..., :3], size="small", context=context)
    with pytest.raises(ValueError, match="; got 5 and 2"):
        flnr(target[..., :2], guides, context=context)


@pytest.mark.parametrize("method", ["flnr-small", "flnr"])
def test_shipped_networks(context: Context, frame: jflnr.Frame, method: str) -> None:
    found = jflnr.denoise(frame, method, backend="opencl")
    right = np.asarray(jflnr.denoise(frame, method))
    assert error(np.asarray(found), right) < tolerances.ADAPTIVE


def test_real_frames(context: Context, data: Path) -> None:
    for path in sorted(data.glob("*/*_0.exr")):
        frame = jflnr.read_frame(path, spp=1)
        found = jflnr.denoise(frame, "flnr-small", backend="opencl")
        right = np.asarray(jflnr.denoise(frame, "flnr-small"))
        assert error(np.asarray(found), right) < tolerances.ADAPTIVE, path


def test_command_line(
    context: Context, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["denoise", str(frame_file), "-o", str(frame_file.with_name("out.exr"))]
    command += ["--backend", "opencl", "--method", "flnr-small"]
    assert main([*command, "--profile"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in ("convolve", "join", "correct", "weighted_moments"))
