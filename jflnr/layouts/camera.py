"""Depth and position from each other, where the file says what the camera was."""

from collections.abc import Mapping
from math import radians, tan
from typing import Any, NamedTuple

import numpy as np

from jflnr.exr import Window


class Camera(NamedTuple):
    """A pinhole camera that looks along its +z, its x to the left, its y up (DESIGN.md)."""

    to_world: np.ndarray  # (4, 4)
    fov_x: float | None  # degrees, of the whole display window

    @classmethod
    def of(cls, header: Mapping[str, Any]) -> "Camera | None":
        """From our own header's entries or the attribute `worldToCamera`, as pbrt writes it."""
        try:
            if "worldToCamera" in header:
                to_camera = np.array(header["worldToCamera"], np.float64).reshape(4, 4)
                return cls(np.linalg.inv(to_camera), None)
            matrix = np.array(header["camera_to_world"], np.float64).reshape(4, 4)
            return cls(matrix, float(header["fov_x_degrees"]))
        except (KeyError, TypeError, ValueError, OverflowError, np.linalg.LinAlgError):
            return None

    def depth(self, position: np.ndarray, hit: np.ndarray) -> np.ndarray:
        """Depth (H, W, 1) along the view axis of world points (H, W, 3); 0 where not `hit`."""
        axis, origin = self.to_world[:3, 2], self.to_world[:3, 3]
        return np.where(hit, ((position - origin) @ axis)[..., None], 0).astype(np.float32)

    def position(self, depth: np.ndarray, window: Window) -> np.ndarray:
        """World points (H, W, 3) at a depth (H, W, 1); 0 where depth is 0."""
        height, width = depth.shape[:2]
        if self.fov_x is None:
            raise ValueError("the camera's field of view is not known")
        (x0, y0), display = window
        left, top, right, bottom = display or (x0, y0, x0 + width - 1, y0 + height - 1)
        full_width, full_height = right - left + 1, bottom - top + 1
        slope = tan(radians(self.fov_x) / 2)
        y, x = np.mgrid[:height, :width] + 0.5
        across = (1 - 2 * (x + x0 - left) / full_width) * slope
        up = (1 - 2 * (y + y0 - top) / full_height) * slope * full_height / full_width
        local = np.stack([across, up, np.ones_like(x)], axis=-1) * depth
        points = local @ self.to_world[:3, :3].T + self.to_world[:3, 3]
        return np.where(depth > 0, points, 0).astype(np.float32)
