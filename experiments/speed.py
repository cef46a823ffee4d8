"""Time of a frame, alone and with a history, against the memory floor; how it grows."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data
from experiments.methods import backends
from experiments.peers import guided, svgf
from experiments.results import Parts, Row
from experiments.shots import SPATIAL, made_up
from experiments.timing import interleaved
from jflnr.bmfr.fit import fit
from jflnr.frame import Frame
from jflnr.images.guides import layers
from jflnr.network.flnr import FLNR
from jflnr.opencl import adaptive as adaptive_kernels
from jflnr.opencl import flnr as flnr_kernels
from jflnr.opencl import flr as flr_kernels
from jflnr.opencl.context import default_context
from jflnr.opencl.profile import profile
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.flr import DEFAULT, flr

NAME = "speed"
QUESTION = "What does a frame take, against the memory floor and others, and how does it grow?"
MINUTES = 13

WIDTH, HEIGHT = 1920, 1080
OIDN: dict[str, dict[str, Any]] = {
    "OIDN fast": {"quality": "fast", "clean": False},
    "OIDN high": {"quality": "high", "clean": False},
    "OIDN high, clean auxiliaries": {"quality": "high", "clean": True},
}
# Methods whose kernels are timed by themselves too, and their constants.
OPENCL: dict[str, tuple[Callable[..., Any], Any]] = {
    "flr": (flr_kernels.flr, DEFAULT),
    "flr-adaptive": (adaptive_kernels.flr_adaptive, AdaptiveFLR()),
    "flnr": (flnr_kernels.flnr, FLNR()),
}


def run(quick: bool) -> Parts:
    """Milliseconds of frames and of frames of sequences, and how they grow; memory, kernels."""
    frame = enlarge(jflnr.read_frame(data.frames("test")[0]), HEIGHT, WIDTH)
    size = (90, 160) if quick else (720, 1280)
    repeats = 3 if quick else 15
    found = {
        "frames of 1920 x 1080": timed(methods_on(frame), "flr, JAX", repeats),
        "memory": [memory()],
        "kernels, 1920 x 1080": kernels(frame),
        "frames of sequences, 1280 x 720": timed(over_time(*size), "BMFR, JAX", repeats),
    }
    counts, sizes = ((2, 5), (0.05,)) if quick else ((1, 3, 5, 9, 14), (0.23, 3.69))
    base = sizes[0] if quick else 0.92
    grown = [growth(base, guides, quick) for guides in counts]
    grown += [growth(megapixels, 5, quick) for megapixels in sizes]
    return found | {"growth": [row for rows in grown for row in rows]}


def timed(calls: dict[str, Callable[[], Any]], basis: str, repeats: int) -> list[Row]:
    """Milliseconds of each, also by the memory floor and by one of them."""
    seconds = interleaved(calls, repeats)
    floor = seconds["memory floor"]
    return [
        {"method": name, "ms": 1e3 * t, "floors": t / floor, f"x {basis}": t / seconds[basis]}
        for name, t in seconds.items()
    ]


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
    for method in jflnr.METHODS:
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


def synthetic(megapixels: float, guides: int, channels: int) -> tuple[jax.Array, jax.Array]:
    """Random images of 16 : 9."""
    height = round((megapixels * 1e6 * 9 / 16) ** 0.5 / 8) * 8
    width = round(megapixels * 1e6 / height / 8) * 8
    generator = np.random.default_rng(0)
    x = generator.random((height, width, guides), np.float32)
    return jnp.asarray(generator.random((height, width, channels), np.float32)), jnp.asarray(x)


def growth(megapixels: float, guides: int, quick: bool) -> list[Row]:
    """FLR, BMFR's QR and the guided filter on random images of one size, all compiled by JAX."""
    y, x = synthetic(megapixels, guides, 3)
    weight = jnp.ones_like(y[..., :1])
    calls: dict[str, Callable[[], Any]] = {
        "flr": lambda: _flr(y, x, DEFAULT).block_until_ready(),
        "bmfr": lambda: _bmfr(y, x).block_until_ready(),
        "guided": lambda: _guided(y, x, weight).block_until_ready(),
    }
    about = {"guides": guides, "megapixels": y.shape[0] * y.shape[1] / 1e6}
    seconds = interleaved(calls, 1 if quick else 4)
    return [{"method": name, **about, "ms": 1e3 * t} for name, t in seconds.items()]


_flr = jax.jit(flr)


@jax.jit
def _bmfr(y: jax.Array, x: jax.Array) -> jax.Array:
    surface = jnp.ones_like(y[..., :1], bool)
    return fit(y, x, surface, 0, jnp.zeros(2, int))


@jax.jit
def _guided(y: jax.Array, x: jax.Array, weight: jax.Array) -> jax.Array:
    slopes, offset = guided.models(x, y, weight, 24, 0.01)
    return guided.evaluate(slopes, offset, x)


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


def over_time(height: int, width: int) -> dict[str, Callable[[], Any]]:
    """Name to a call that denoises the second frame of a sequence."""
    before, now = (enlarge(frame, height, width) for frame in made_up(2).frames)
    kernels = of_ours("OpenCL", before, now) if "opencl" in backends() else {}
    return kernels | by_jax(before, now)


def by_jax(before: Frame, now: Frame) -> dict[str, Callable[[], Any]]:
    """Name to a call that denoises `now` after `before`, and waits; and the memory floor."""
    source = np.ones((*now.depth.shape[:2], 8), np.float32)  # five guides and the light
    target = np.zeros_like(source)
    found: dict[str, Callable[[], Any]] = {"memory floor": lambda: np.copyto(target, source)}
    frames = [jax.tree.map(jnp.asarray, frame) for frame in (before, now)]
    found |= of_ours("JAX", *frames)
    state, _ = svgf.step(svgf.start(frames[0]), frames[0])
    step = functools.partial(svgf.step, jax.block_until_ready(state), frames[1])
    return found | {"SVGF, JAX": functools.partial(finished, step)}


def of_ours(backend: str, before: Frame, now: Frame) -> dict[str, Callable[[], Any]]:
    """Name to a call that denoises `now` after `before`, on one back end."""
    names = {f"{method}, temporal": method for method in SPATIAL} | {"BMFR": "bmfr"}
    return {f"{name}, {backend}": second(m, backend, before, now) for name, m in names.items()}


def second(method: str, backend: str, before: Frame, now: Frame) -> Callable[[], Any]:
    """A call from the first frame to the second, which begins at the same state every time."""
    denoiser = jflnr.Denoiser(method, backend=backend.lower())
    denoiser.next(before)
    state = denoiser.state

    def call() -> Any:
        denoiser.state = state
        return finished(functools.partial(denoiser.next, now))

    return call
