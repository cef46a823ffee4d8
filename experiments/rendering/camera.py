"""Where the renderer's cameras stand."""

from __future__ import annotations

from math import radians, tan

import numpy as np

from jflnr.camera import Camera


def looking(origin: object, target: object, fov_x: float, up: object = (0.0, 1.0, 0.0)) -> Camera:
    """A camera at `origin` that looks at `target`."""
    eye = np.asarray(origin, float)
    forward = np.asarray(target, float) - eye
    forward /= np.linalg.norm(forward)
    left = np.cross(np.asarray(up, float), forward)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(forward, left), forward, eye], 1)
    return Camera(matrix, float(fov_x))


def slopes(camera: Camera, width: int, height: int) -> tuple[float, float]:
    """Slopes of the rays through the left and the upper edge of the picture."""
    x = tan(radians(camera.fov_x) / 2)
    return x, x * height / width
