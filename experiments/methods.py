"""Every denoiser that can be run here, ours and the peers, under one signature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments.peers import atrous, bmfr, figure3, guided, svgf
from jflnr.frame import Array, Frame

Denoiser = Callable[..., Array]


def unchanged(frame: Frame) -> Frame:
    """The frame as it was read."""
    return frame


@dataclass(frozen=True)
class Method:
    """A denoiser with its parameters: `denoise(frame, **parameters) -> (H, W, 3)`.

    on_device: whether it takes arrays of JAX. stored: the frame as this method's user keeps it.
    """

    name: str
    family: str
    denoise: Denoiser
    parameters: Mapping[str, Any]
    on_device: bool = True
    stored: Callable[[Frame], Frame] = unchanged

    def __call__(self, frame: Frame) -> np.ndarray:
        """The denoised, demodulated light `(H, W, 3)`."""
        return np.asarray(self.denoise(self.stored(frame), **self.parameters))

    def prepare(self, frame: Frame) -> Callable[[], Any]:
        """A call to be timed: it denoises the frame, already where it is needed, and waits."""
        frame = self.stored(frame)
        if self.family == "OIDN":
            from experiments.peers.oidn import filter_for

            return filter_for(frame, **self.parameters)
        here = jax.tree.map(jnp.asarray, frame) if self.on_device else frame
        return lambda: jax.block_until_ready(self.denoise(here, **self.parameters))


def noisy(frame: Frame) -> Array:
    """What comes in."""
    return frame.indirect


def ours() -> list[Method]:
    """`jflnr.denoise`, every method on every backend that is there."""
    found = []
    for backend in backends():
        for method in (name for name in jflnr.METHODS if name != "bmfr"):  # which is a peer
            name = method if backend == "jax" else f"{method} ({backend})"
            parameters = {"method": method, "backend": backend}
            found.append(Method(name, "jflnr", jflnr.denoise, parameters, backend == "jax"))
    return found


def backends() -> list[str]:
    """The backends that can be used on this machine."""
    names = list(jflnr.BACKENDS)
    if "opencl" in names:
        from jflnr.opencl.devices import NoDevice, choose

        try:
            choose()
        except NoDevice as error:
            print(f"  The opencl backend is left out: {error}")
            names.remove("opencl")
    return names


def peers() -> list[Method]:
    """Others' denoisers, each with its paper's parameters and with those tuned on val."""
    pairs: list[tuple[str, Denoiser, Mapping[str, Any], Mapping[str, Any]]] = [
        ("guided filter", guided.denoise, guided.PAPER, guided.TUNED),
        ("fast guided filter", guided.denoise, guided.FAST_PAPER, guided.FAST_TUNED),
        ("a-trous", atrous.denoise, atrous.PAPER, atrous.TUNED),
        ("SVGF, spatial", svgf.denoise, svgf.PAPER, svgf.TUNED),
        ("BMFR, one frame", bmfr.denoise, bmfr.PAPER, bmfr.TUNED),
    ]
    found = []
    for name, denoiser, paper, tuned in pairs:
        found.append(Method(name, name, denoiser, paper))
        found.append(Method(f"{name}, tuned", name, denoiser, tuned))
    return [*found, *oidn_peers()]


def oidn_peers() -> list[Method]:
    """OIDN as the paper ran it, and the best of its settings on val; nothing without pyoidn."""
    try:
        from experiments.peers import oidn
    except ImportError:
        print("  pyoidn is not installed: OIDN is left out.")
        return []
    settings = {"OIDN": oidn.PAPER, "OIDN, tuned": oidn.TUNED, "OIDN fast, tuned": oidn.FAST_TUNED}
    return [Method(name, "OIDN", oidn.denoise, chosen, False) for name, chosen in settings.items()]


def basic() -> list[Method]:
    """The noisy input and the paper's Figure 3."""
    return [
        Method("noisy", "input", noisy, {}, False),
        Method("Figure 3", "Figure 3", figure3.denoise, {}, False),
    ]


FAMILIES = (
    "OIDN",
    "guided filter",
    "BMFR, one frame",
    "fast guided filter",
    "SVGF, spatial",
    "a-trous",
)


def family(method: str) -> str:
    """Whose a method of this name is."""
    return next((name for name in FAMILIES if method.startswith(name)), "jflnr")
