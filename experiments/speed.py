"""Time of FLR against the memory floor and against OIDN, and how it grows."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, results
from jflnr import opencl
from jflnr.network import weights
from jflnr.regression.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.regression.parameters import DEFAULT
from jflnr.regression.flr import flr
from jflnr.guides import layers
from jflnr.opencl.context import default_context
from jflnr.opencl.profile import profile

NAME = "speed"
QUESTION = "How many times the memory floor does FLR take, and how much less than OIDN?"
MINUTES = 7

WIDTH, HEIGHT = 1920, 1080
OIDN: dict[str, dict[str, Any]] = {
    "OIDN fast": {"quality": "fast", "clean": False},
    "OIDN high": {"quality": "high", "clean": False},
    "OIDN high, clean auxiliaries": {"quality": "high", "clean": True},
}
# Methods whose kernels are timed by themselves too, and their constants.
OPENCL: dict[str, tuple[Callable[..., Any], Any]] = {
    "flr": (opencl.flr, DEFAULT),
    "flr-adaptive": (opencl.flr_adaptive, ADAPTIVE_DEFAULT),
    "flnr": (opencl.flnr, weights.shipped("flnr")),
}


def run(quick: bool) -> dict[str, Any]:
    """Milliseconds at 1920 x 1080, five guides, block 8; growth with pixels, guides, channels."""
    repeats = 3 if quick else 15
    frame = enlarge(jflnr.read_frame(data.frames("test")[0]), HEIGHT, WIDTH)
    methods = methods_on(frame)
    seconds = interleaved(methods, repeats)
    floor = seconds["memory floor"]
    rows: list[dict[str, Any]] = [
        {"method": name, "ms": 1e3 * t, "floors": t / floor, "per_flr": t / seconds["flr, JAX"]}
        for name, t in seconds.items()
    ]
    for row in rows:
        print(f"  {row['method']}: {row['ms']:.1f} ms, {row['floors']:.1f} x the floor", flush=True)
    sizes = (0.25, 1, 2) if quick else (0.25, 0.5, 1, 2, 4, 8, 16, 33)
    return {
        "methods": rows,
        "memory": memory(),
        "kernels": kernels(frame),
        "pixels": [growth(megapixels=size) for size in sizes],
        "guides": [growth(guides=q) for q in ((0, 5) if quick else (0, 1, 2, 3, 5, 8, 12))],
        "channels": light_groups((3, 9) if quick else (3, 6, 9, 15)),
    }


def methods_on(frame: jflnr.Frame) -> dict[str, Callable[[], Any]]:
    """Name to a call that denoises the frame and waits for the result."""
    source = np.ones((HEIGHT, WIDTH, 8), np.float32)
    target = np.zeros_like(source)
    guides = jnp.concatenate(layers(frame, ("normal", "depth", "ao")), axis=-1)
    noisy = jnp.asarray(frame.indirect)
    compiled = jax.jit(flr, static_argnames=("block", "support"))
    on_device = jax.tree.map(jnp.asarray, frame)
    calls: dict[str, Callable[[], Any]] = {
        "memory floor": lambda: np.copyto(target, source),
        "flr, JAX": lambda: compiled(noisy, guides, DEFAULT).block_until_ready(),
    }
    for method in jflnr.METHODS:
        denoise = functools.partial(jflnr.denoise, on_device, method)
        calls[f"denoise {method}, JAX"] = functools.partial(finished, denoise)
    for method in (m for m in jflnr.METHODS if m != "auto"):  # which has no kernels
        denoise = functools.partial(jflnr.denoise, frame, method, backend="opencl")
        calls[f"denoise {method}, OpenCL"] = functools.partial(finished, denoise)
    for method in OPENCL:
        calls[f"{method}, OpenCL"] = opencl_call(frame, method)
    return calls | oidn_calls(frame)


def opencl_call(frame: jflnr.Frame, method: str = "flr") -> Callable[[], Any]:
    """The kernels of a method on the same arrays as `flr, JAX`, in numpy."""
    guides = np.concatenate(layers(frame, ("normal", "depth", "ao")), axis=-1)
    function, parameters = OPENCL[method]
    return functools.partial(function, np.asarray(frame.indirect), guides, parameters)


def kernels(frame: jflnr.Frame) -> list[dict[str, Any]]:
    """Each kernel's time, bytes and share of the copy bandwidth, method by method."""
    return [
        row._asdict() | {"mb": row.bytes / 1e6, "method": method}
        for method in OPENCL
        for row in profile(default_context(), opencl_call(frame, method))
    ]


def finished(call: Callable[[], Any]) -> Any:
    """The result of a call, waited for."""
    return jax.block_until_ready(call())


def oidn_calls(frame: jflnr.Frame) -> dict[str, Callable[[], Any]]:
    """OIDN on the demodulated light, with the same frame's albedo and normal."""
    try:
        from experiments.peers.oidn import filter_for
    except ImportError:
        print("  pyoidn is not installed: OIDN is left out.")
        return {}
    return {name: filter_for(frame, **options) for name, options in OIDN.items()}


def interleaved(calls: dict[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """The best time of each call in seconds, taken in turns so that all meet the same machine."""
    best = dict.fromkeys(calls, float("inf"))
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            best[name] = min(best[name], time.perf_counter() - start)
    return best


def synthetic(megapixels: float, guides: int, channels: int) -> tuple[jax.Array, jax.Array]:
    """Random images of 16 : 9."""
    height = round((megapixels * 1e6 * 9 / 16) ** 0.5 / 8) * 8
    width = round(megapixels * 1e6 / height / 8) * 8
    generator = np.random.default_rng(0)
    x = generator.random((height, width, guides), np.float32)
    return jnp.asarray(generator.random((height, width, channels), np.float32)), jnp.asarray(x)


def growth(megapixels: float = 2.0736, guides: int = 5, channels: int = 3) -> dict[str, Any]:
    """Time of compiled FLR on one size."""
    y, x = synthetic(megapixels, guides, channels)
    compiled = jax.jit(flr)
    call = lambda: compiled(y, x, DEFAULT).block_until_ready()
    seconds = interleaved({"flr": call}, 7)["flr"]
    return {
        "megapixels": y.shape[0] * y.shape[1] / 1e6,
        "guides": guides,
        "channels": channels,
        "ms": 1e3 * seconds,
    }


def light_groups(counts: tuple[int, ...]) -> list[dict[str, Any]]:
    """Light groups denoised together, against as many separate runs of three channels."""
    alone = growth(channels=3)["ms"]
    rows = []
    for channels in counts:
        together = growth(channels=channels)["ms"]
        separate = alone * channels / 3
        rows.append({"groups": channels // 3, "together": together, "separate": separate})
    return rows


def memory() -> dict[str, float]:
    """Memory that the compiled program takes beside its input and output, per byte of input."""
    y, x = synthetic(2.0736, 5, 3)
    analysis = jax.jit(flr).lower(y, x, DEFAULT).compile().memory_analysis()
    assert analysis is not None
    inputs = y.nbytes + x.nbytes
    return {
        "input_mb": inputs / 1e6,
        "output_mb": y.nbytes / 1e6,
        "temporary_mb": analysis.temp_size_in_bytes / 1e6,
        "extra_per_input": (analysis.temp_size_in_bytes + y.nbytes) / inputs,
    }


def enlarge(frame: jflnr.Frame, height: int, width: int) -> jflnr.Frame:
    """The frame repeated to a larger size: real values, real cost."""

    def repeat(layer: np.ndarray) -> np.ndarray:
        times = (-(-height // layer.shape[0]), -(-width // layer.shape[1]), 1)
        return np.ascontiguousarray(np.tile(layer, times)[:height, :width])

    return jax.tree.map(repeat, frame)


def draw(result: dict[str, Any], folder: Path) -> None:
    """speed.md, and speed.png with the growth in pixels and guides."""
    columns = {"method": "method", "ms": "ms", "floors": "x floor", "per_flr": "x FLR (JAX)"}
    text = results.table(result["methods"], columns)
    text += "\n" + results.table([result["memory"]], {key: key for key in result["memory"]})
    groups = {"groups": "light groups", "together": "together, ms", "separate": "separately, ms"}
    text += "\n" + results.table(result["channels"], groups)
    kernel_columns = {
        "method": "method",
        "kernel": "kernel",
        "ms": "ms",
        "mb": "MB",
        "share": "share of copy bandwidth",
    }
    text += "\n" + results.table(result["kernels"], kernel_columns)
    plots.write_text(folder / f"{NAME}.md", text)
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        plots.power_law(left, result["pixels"], "megapixels", "frame size, megapixels")
        plots.against(right, result["guides"], "guides", "guides Q")
