"""Motion vectors from depth and two cameras, where the renderer wrote none."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import checks
from jflnr.camera import Camera, centres
from jflnr.frame import Array, Frame

# Where nothing is hit, so many scene units away: a turn of the camera moves it, a step does not.
SKY = 1e6


def camera_motion(depth: Array, camera: Camera, before: Camera) -> jax.Array:
    """Pixels from here to where each point was in the previous frame, if only the camera moved.

    depth: `(H, W, 1)`, along the view axis, scene units; 0 where nothing is hit. camera, before:
    those of this frame and of the previous one. Returns `(H, W, 2)`, (x, y), NaN for a point that
    was behind the camera.
    """
    checks.image("depth", depth, 1)
    height, width = depth.shape[:2]
    here = jnp.asarray(centres(width, height), jnp.result_type(float))
    far = jnp.where(depth > 0, depth, SKY)[..., 0]
    # About the earlier camera's place: of large world coordinates float32 keeps too little.
    now, then = (jnp.asarray(c.to_world) for c in (camera, before))
    points = Camera(now.at[:3, 3].add(-then[:3, 3]), camera.fov_x).points(here, far, width, height)
    there = Camera(then.at[:3, 3].set(0), before.fov_x).project(points, width, height)
    return there - here


def with_motion(frame: Frame, header: dict[str, Any], before: dict[str, Any]) -> Frame:
    """The frame with motion from its camera and the last frame's, if it has none and they do.

    header, before: what `read_header` gives of this file and of the last.
    """
    camera, last = Camera.of(header), Camera.of(before)
    if frame.motion is not None or camera is None or last is None:
        return frame
    return dataclasses.replace(frame, motion=np.asarray(camera_motion(frame.depth, camera, last)))
