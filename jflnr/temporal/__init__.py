"""Sequences of frames: reprojection, accumulation over time, and denoising with a history."""

from jflnr.camera import Camera
from jflnr.temporal.accumulate import Average, accumulate, reproject
from jflnr.temporal.camera import camera_motion
from jflnr.temporal.reproject import Surface, Taps, find_taps, gather
from jflnr.temporal.sequence import State, Temporal, start, step

__all__ = [
    "Average",
    "Camera",
    "State",
    "Surface",
    "Taps",
    "Temporal",
    "accumulate",
    "camera_motion",
    "find_taps",
    "gather",
    "reproject",
    "start",
    "step",
]
