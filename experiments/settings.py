"""The settings of FLR and of OIDN whose accuracy and time are charted against each other."""

from __future__ import annotations

import itertools
from typing import Any

import jax
import numpy as np

import jflnr
from experiments.methods import Method, backends
from jflnr.frame import Frame

GUIDES = (("normal", "depth"), ("normal", "depth", "ao", "position"))


def flr_settings() -> list[Method]:
    """Block, guides, sigma, precision, on every backend; the default itself is left out."""
    options: dict[str, dict[str, Any]] = {f"block {b}": {"block": b} for b in (1, 2, 4, 16, 32)}
    options |= {f"guides {'+'.join(names)}": {"guides": names} for names in GUIDES}
    options |= {f"sigma {sigma:g}": {"sigma": sigma} for sigma in (8.0, 24.0)}
    found = []
    for backend in backends():
        suffix = "" if backend == "jax" else f" ({backend})"
        for name, chosen in options.items():
            parameters = {"method": "flr", "backend": backend} | chosen
            on_device = backend == "jax"
            found.append(
                Method(f"flr, {name}{suffix}", "jflnr", jflnr.denoise, parameters, on_device)
            )
        half = {"method": "flr", "backend": backend}
        name = f"flr, half{suffix}"
        found.append(Method(name, "jflnr", jflnr.denoise, half, backend == "jax", to_half))
    return found


def to_half(frame: Frame) -> Frame:
    """All layers as float16."""
    return jax.tree.map(lambda layer: np.asarray(layer, np.float16), frame)


def oidn_settings() -> list[Method]:
    """All twelve settings of OIDN, or none without pyoidn."""
    try:
        from experiments.peers import oidn
    except ImportError:
        return []
    found = []
    for quality, clean, modulated in itertools.product(oidn.QUALITY, (False, True), (False, True)):
        auxiliary = "clean" if clean else "noisy"
        name = f"OIDN {quality}, {auxiliary} aux., {'' if modulated else 'de'}modulated"
        options = {"quality": quality, "clean": clean, "modulated": modulated}
        found.append(Method(name, "OIDN", oidn.denoise, options, False))
    return found
