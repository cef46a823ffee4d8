"""Denoising of one-sample path-traced light by Fast Local (Neural) Regression."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jflnr import temporal
    from jflnr.auto.method import Auto, select
    from jflnr.bmfr.pipeline import BMFR
    from jflnr.denoising import Denoiser, denoise
    from jflnr.frame import Frame, composite, read_frame, read_header, write_frame
    from jflnr.methods import BACKENDS, METHODS
    from jflnr.network.flnr import FLNR, flnr
    from jflnr.parameters import load_parameters, save_parameters
    from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
    from jflnr.regression.flr import FLR, flr
    from jflnr.regression.picture import Picture, denoise_picture

__version__ = "0.1.0"

_HOMES = {
    "BACKENDS": "methods",
    "BMFR": "bmfr.pipeline",
    "FLNR": "network.flnr",
    "FLR": "regression.flr",
    "METHODS": "methods",
    "AdaptiveFLR": "regression.adaptive",
    "Auto": "auto.method",
    "Denoiser": "denoising",
    "Frame": "frame",
    "Picture": "regression.picture",
    "composite": "frame",
    "denoise": "denoising",
    "denoise_picture": "regression.picture",
    "flnr": "network.flnr",
    "flr": "regression.flr",
    "flr_adaptive": "regression.adaptive",
    "load_parameters": "parameters",
    "read_frame": "frame",
    "read_header": "frame",
    "save_parameters": "parameters",
    "select": "auto.method",
    "temporal": "temporal",
    "write_frame": "frame",
}
__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Import what is asked for: JAX takes a second, which `jflnr --help` need not wait for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = importlib.import_module(f"jflnr.{_HOMES[name]}")
    return home if name == _HOMES[name] else getattr(home, name)


def __dir__() -> list[str]:
    return __all__
