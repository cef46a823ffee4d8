"""Any method piece by piece."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from jflnr import flnr
from jflnr import guides as guide_layers
from jflnr.denoising import Part, denoise_flr, support_of
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.parameters import DEFAULT
from jflnr.frame import Array, Frame
from jflnr.large import local, pyramid
from jflnr.large.local import Strip
from jflnr.large.source import Rows, rows_of, scene_of, shift_of

__all__ = ["Options", "Strip", "denoise", "options", "rows_of"]


class Options(NamedTuple):
    """The arguments of `jflnr.denoise`; `names` of the guides, and `parameters`, are given."""

    method: str
    parameters: Any
    names: tuple[str, ...]
    block: int
    backend: str = "jax"
    keep_energy: bool = False


def options(settings: Mapping[str, Any], names: tuple[str, ...]) -> Options:
    """From keyword arguments of `jflnr.denoise`."""
    method = settings["method"]
    parameters = settings.get("parameters") or default_parameters(method)
    return Options(method, parameters, names, settings["block"], settings["backend"])


def denoise(rows: Rows, options: Options, tile: int, folder: Path | None = None) -> Iterator[Strip]:
    """Denoise a frame in strips from top to bottom.

    tile: side in pixels of a square as large as what is worked on at a time. folder: where
    temporary files go; the system's own if None.
    """
    method, parameters, names, block, backend, keep_energy = options
    if method == "flr":
        support = support_of(parameters, max(rows.height, rows.width))
        scene = scene_of(rows)

        def images(frame: Frame) -> tuple[Any, Any]:
            mask = frame.mask
            weight = None if mask is None else mask[..., 0] > 0
            return guide_layers.layers(frame, names, scene), weight

        part = Part(support, scene, shift_of(rows, images))

        def one(frame: Frame) -> Array:
            return denoise_flr(frame, parameters, names, block, backend, part)

        height = max(tile * tile // rows.width, 1)
        return local.strips(rows, one, height=height, block=block, support=support)
    methods = ("flr-adaptive", *flnr.METHODS)
    if method not in methods or backend != "jax":
        advice = ", or take --backend jax" if method in methods else ""
        raise ValueError(
            f"method {method} on {backend} needs the whole frame in memory: raise --memory{advice}"
        )
    pieces = functools.partial(
        pyramid.strips, rows, block=block, tile=tile, keep_energy=keep_energy, folder=folder
    )
    if method == "flr-adaptive":
        return pieces(names, parameters)
    from jflnr.flnr.features import GUIDES
    from jflnr.flnr.method import check
    from jflnr.large.network import correct

    light = rows.height // rows.factor, rows.width // rows.factor, rows.channels
    check(method, names, light, (rows.height, rows.width, 3))
    network = functools.partial(correct, params=parameters)
    return pieces(GUIDES, ADAPTIVE_DEFAULT, network=network)


def default_parameters(method: str) -> Any:
    """The parameters of a method when nobody says."""
    if method in flnr.METHODS:
        from jflnr.flnr import weights

        return weights.shipped(method)
    return DEFAULT if method == "flr" else ADAPTIVE_DEFAULT
