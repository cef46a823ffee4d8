"""Sequences of frames: reprojection, accumulation over time, and denoising with a history."""

from jflnr.camera import Camera
from jflnr.temporal.accumulate import Average, accumulate, reproject
from jflnr.temporal.camera import camera_motion
from jflnr.temporal.reproject import Surface, Taps, find_taps, gather
from jflnr.temporal.sequence import State, Temporal, start, step
