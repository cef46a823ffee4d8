"""The pinhole camera: looks along its +z, its x to the left, its y up."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """`to_world` is (4, 4), camera to world; `fov_x` the full horizontal angle in degrees."""

    to_world: NDArray[np.float64]
    fov_x: float

    @classmethod
    def looking(
        cls, origin: object, target: object, fov_x: float, up: object = (0.0, 1.0, 0.0)
    ) -> Camera:
        """A camera at `origin` that looks at `target`."""
        eye = np.asarray(origin, float)
        forward = np.asarray(target, float) - eye
        forward /= np.linalg.norm(forward)
        left = np.cross(np.asarray(up, float), forward)
        left /= np.linalg.norm(left)
        matrix = np.eye(4)
        matrix[:3] = np.stack([left, np.cross(forward, left), forward, eye], 1)
        return cls(matrix, float(fov_x))

    def slopes(self, width: int, height: int) -> tuple[float, float]:
        """Slopes of the rays through the left and the upper edge of the picture."""
        x = tan(radians(self.fov_x) / 2)
        return x, x * height / width

    def project(self, points: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
        """Pixel coordinates `(..., 2)` of world points `(..., 3)`; a pixel's centre is at .5."""
        local = (np.asarray(points, float) - self.to_world[:3, 3]) @ self.to_world[:3, :3]
        sx, sy = self.slopes(width, height)
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = local[..., 0] / local[..., 2] / sx, local[..., 1] / local[..., 2] / sy
        return np.stack([(1 - x) * width / 2, (1 - y) * height / 2], -1)

    def points(
        self,
        pixels: NDArray[np.float64],
        depth: NDArray[np.float64],
        width: int,
        height: int,
    ) -> NDArray[np.float64]:
        """World points `(..., 3)` at a depth along the view axis, seen at pixels `(..., 2)`."""
        sx, sy = self.slopes(width, height)
        x = (1 - 2 * pixels[..., 0] / width) * sx
        y = (1 - 2 * pixels[..., 1] / height) * sy
        local = np.stack([x, y, np.ones_like(x)], -1) * depth[..., None]
        return local @ self.to_world[:3, :3].T + self.to_world[:3, 3]
