"""A made-up shot for the tests of BMFR: a floor, a wall and the sky pass by under noise."""

from __future__ import annotations

import numpy as np

from jflnr.frame import Frame

STEP = np.array([-1.25, 0.5], np.float32)


def shot(frames: int, height: int, width: int, *, noise: bool = True) -> list[Frame]:
    """Frames of a world that moves by `STEP` pixels; its light is 1 without noise."""
    return [_frame(number, height, width, noise) for number in range(frames)]


def _frame(number: int, height: int, width: int, noise: bool) -> Frame:
    random = np.random.default_rng(number)
    y, x = np.mgrid[:height, :width].astype(np.float32)[..., None]
    u, v = x + number * STEP[0], y + number * STEP[1]
    floor, sky = v > 0.6 * height, u > 0.8 * width
    normal = np.where(floor, [0, 1, 0], [0, 0, 1]) * ~sky
    depth = np.where(floor, 3 - v / height, 2.4) * ~sky
    light = np.ones((height, width, 3))
    if noise:
        light = random.exponential(size=light.shape) * (1 + np.sin(u / 9)) * (1 + floor)
    layers = {
        "indirect": light,
        "albedo": 0.5 + 0.4 * np.sin(u / 5 + v / 3 + np.arange(3)),
        "normal": normal,
        "depth": depth,
        "position": np.concatenate([u, v, depth * height], axis=-1) / height,
        "mask": ~sky,
        "motion": np.broadcast_to(STEP, (height, width, 2)),
    }
    return Frame(**{name: np.float32(layer) for name, layer in layers.items()})
