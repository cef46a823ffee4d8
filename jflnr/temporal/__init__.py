"""Sequences of frames: reprojection, accumulation over time, and denoising with a history."""

from jflnr.temporal.camera import Camera, camera_motion
from jflnr.temporal.reproject import Surface, Taps, find_taps, gather

__all__ = ["Camera", "Surface", "Taps", "camera_motion", "find_taps", "gather"]
