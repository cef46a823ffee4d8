"""Depth and position from each other, where the file says what the camera was."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jflnr.camera import Camera, centres
from jflnr.exr import Window


def camera_of(header: Mapping[str, Any]) -> Camera | None:
    """From our own header's entries or the attribute `worldToCamera`, as pbrt writes it.

    The latter does not say the field of view, which then is None.
    """
    try:
        if "worldToCamera" not in header:
            return Camera.of(header)
        to_camera = np.array(header["worldToCamera"], np.float64).reshape(4, 4)
        return Camera(np.linalg.inv(to_camera), None)
    except (TypeError, ValueError, OverflowError, np.linalg.LinAlgError):
        return None


def depth_of(camera: Camera, position: np.ndarray, hit: np.ndarray) -> np.ndarray:
    """Depth (H, W, 1) along the view axis of world points (H, W, 3); 0 where not `hit`."""
    axis, origin = camera.to_world[:3, 2], camera.to_world[:3, 3]
    return np.where(hit, ((position - origin) @ axis)[..., None], 0).astype(np.float32)


def position_of(camera: Camera, depth: np.ndarray, window: Window) -> np.ndarray:
    """World points (H, W, 3) at a depth (H, W, 1); 0 where depth is 0."""
    height, width = depth.shape[:2]
    (x0, y0), display = window
    left, top, right, bottom = display or (x0, y0, x0 + width - 1, y0 + height - 1)
    pixels = centres(width, height) + np.array([x0 - left, y0 - top])
    points = camera.points(pixels, depth[..., 0], right - left + 1, bottom - top + 1)
    return np.where(depth > 0, points, 0).astype(np.float32)
