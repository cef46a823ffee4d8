"""The pinhole camera. Its methods take arrays of NumPy or of JAX, and return the same."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np


class Camera(NamedTuple):
    """A pinhole camera that looks along its +z, with x to the left and y up.

    to_world: `(4, 4)`, from its space to the world's. fov_x: full horizontal angle in degrees.
    Pixels are (x, y) from the upper left corner of the picture, where a pixel's centre is at .5.
    """

    to_world: Any
    fov_x: Any

    @classmethod
    def of(cls, header: Mapping[str, Any]) -> Camera | None:
        """That of a frame's header (`jflnr.read_header`), or None if it names none.

        Raises `ValueError` if what it says is not a camera.
        """
        if "camera_to_world" not in header or "fov_x_degrees" not in header:
            return None
        try:
            to_world = np.array(header["camera_to_world"], np.float64)
            fov_x = float(header["fov_x_degrees"])
        except (TypeError, ValueError, OverflowError):
            to_world, fov_x = np.zeros(0), 0.0
        if to_world.shape != (4, 4) or not np.isfinite(to_world).all() or not 0 < fov_x < 180:
            raise ValueError(
                "the header's camera_to_world must be 4 x 4 numbers, and fov_x_degrees between 0 "
                f"and 180; got {header['camera_to_world']!r} and {header['fov_x_degrees']!r}"
            )
        return cls(to_world, fov_x)

    def points(self, pixels: Any, depth: Any, width: int, height: int) -> Any:
        """World points `(..., 3)` seen at pixels `(..., 2)`, at a depth `(...)` along the view
        axis, in a picture of the given size."""
        ahead = pixels[..., :1] * 0 + 1
        on_plane = -from_centre(pixels, width, height) / self._pixels(width, pixels)
        local = pixels.__array_namespace__().concatenate([on_plane, ahead], -1) * depth[..., None]
        return local @ self.to_world[:3, :3].T + self.to_world[:3, 3]

    def project(self, points: Any, width: int, height: int) -> Any:
        """Pixels `(..., 2)` of world points `(..., 3)`; NaN of those that are not ahead."""
        xp = points.__array_namespace__()
        local = (points - self.to_world[:3, 3]) @ self.to_world[:3, :3]
        ahead = local[..., 2:] > 0
        on_plane = xp.where(ahead, local[..., :2] / xp.where(ahead, local[..., 2:], 1), xp.nan)
        middle = np.array([width / 2, height / 2], points.dtype)
        return middle - on_plane * self._pixels(width, points)

    def _pixels(self, width: int, like: Any) -> Any:
        """Pixels per unit on the plane one unit ahead."""
        xp = like.__array_namespace__()
        return width / 2 / xp.tan(xp.radians(self.fov_x) / 2)


def centres(width: int, height: int) -> np.ndarray:
    """The pixels' centres, `(H, W, 2)`."""
    y, x = np.mgrid[:height, :width] + 0.5
    return np.stack([x, y], -1)


def from_centre(pixels: Any, width: int, height: int) -> Any:
    """Pixels `(..., 2)` from the centre of the picture, where the view axis passes it."""
    return pixels - np.array([width / 2, height / 2], pixels.dtype)
