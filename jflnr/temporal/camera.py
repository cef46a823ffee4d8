"""Motion vectors from depth and two cameras, where the renderer wrote none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import checks
from jflnr.frame import Array

# Where nothing is hit, so many scene units away: a turn of the camera moves it, a step does not.
SKY = 1e6


class Camera(NamedTuple):
    """A pinhole camera that looks along its +z, with x to the left and y up.

    to_world: `(4, 4)`, from its space to the world's. fov_x: full horizontal angle in degrees.
    """

    to_world: Array
    fov_x: Array | float

    @classmethod
    def of(cls, header: Mapping[str, Any]) -> Camera | None:
        """That of a frame's header (`jflnr.read_header`), or None if it names none.

        Raises `ValueError` if what it says is not a camera.
        """
        if "camera_to_world" not in header or "fov_x_degrees" not in header:
            return None
        try:
            to_world = np.array(header["camera_to_world"], np.float32)
            fov_x = float(header["fov_x_degrees"])
        except (TypeError, ValueError):
            to_world, fov_x = np.zeros(0, np.float32), 0.0
        if to_world.shape != (4, 4) or not np.isfinite(to_world).all() or not 0 < fov_x < 180:
            raise ValueError(
                "the header's camera_to_world must be 4 x 4 numbers, and fov_x_degrees between 0 "
                f"and 180; got {header['camera_to_world']!r} and {header['fov_x_degrees']!r}"
            )
        return cls(to_world, fov_x)


def camera_motion(depth: Array, camera: Camera, before: Camera) -> jax.Array:
    """Pixels from here to where each point was in the previous frame, if only the camera moved.

    depth: `(H, W, 1)`, along the view axis, scene units; 0 where nothing is hit. camera, before:
    those of this frame and of the previous one. Returns `(H, W, 2)`, (x, y), NaN for a point that
    was behind the camera.
    """
    checks.image("depth", depth, 1)
    height, width = depth.shape[:2]
    here = _plane_points(height, width, camera.fov_x)
    rays = jnp.concatenate([here, jnp.ones_like(here[..., :1])], axis=-1)
    # Straight from one camera to the other: of large world coordinates float32 keeps too little.
    now, then = (jnp.asarray(c.to_world) for c in (camera, before))
    points = rays * jnp.where(depth > 0, depth, SKY) @ now[:3, :3].T + (now - then)[:3, 3]
    points = points @ then[:3, :3]
    ahead = points[..., 2:]
    there = jnp.where(ahead > 0, points[..., :2] / jnp.where(ahead > 0, ahead, 1), jnp.nan)
    return here * _pixels(width, camera.fov_x) - there * _pixels(width, before.fov_x)


def _pixels(width: int, fov_x: Array | float) -> jax.Array:
    """Pixels per unit on the plane one unit ahead."""
    return width / 2 / jnp.tan(jnp.radians(fov_x) / 2)


def _plane_points(height: int, width: int, fov_x: Array | float) -> jax.Array:
    """Where the pixels' rays pass the plane one unit ahead, `(H, W, 2)`, x to the left, y up."""
    y, x = jnp.mgrid[:height, :width]
    points = jnp.stack([width / 2 - 0.5 - x, height / 2 - 0.5 - y], axis=-1)
    return points / _pixels(width, fov_x)
