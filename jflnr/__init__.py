"""Denoising of one-sample path-traced light by Fast Local (Neural) Regression."""

from jflnr.denoising import BACKENDS, METHODS, denoise
from jflnr.flr.parameters import Parameters, load_parameters, save_parameters
from jflnr.frame import Frame, composite, read_frame, read_header, write_frame

__version__ = "0.1.0"

__all__ = [
    "BACKENDS",
    "METHODS",
    "Frame",
    "Parameters",
    "composite",
    "denoise",
    "load_parameters",
    "read_frame",
    "read_header",
    "save_parameters",
    "write_frame",
]
