"""Denoising of one-sample path-traced light by Fast Local (Neural) Regression."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jflnr.denoising import BACKENDS, METHODS, denoise
    from jflnr.flr.parameters import Parameters, load_parameters, save_parameters
    from jflnr.frame import Frame, composite, read_frame, read_header, write_frame
    from jflnr.selection.method import select
    from jflnr.uncertainty import denoise_with_error

__version__ = "0.1.0"

__all__ = [
    "BACKENDS",
    "METHODS",
    "Frame",
    "Parameters",
    "composite",
    "denoise",
    "denoise_with_error",
    "load_parameters",
    "read_frame",
    "read_header",
    "save_parameters",
    "select",
    "write_frame",
]

_HOMES = (
    "jflnr.denoising",
    "jflnr.flr.parameters",
    "jflnr.frame",
    "jflnr.selection.method",
    "jflnr.uncertainty",
)


def __getattr__(name: str) -> Any:
    """Import what is asked for: JAX takes a second, which `jflnr --help` need not wait for."""
    if name in __all__:
        for home in map(importlib.import_module, _HOMES):
            if hasattr(home, name):
                return getattr(home, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
