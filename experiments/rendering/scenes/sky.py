"""Skies as small latitude-longitude maps: a gradient, a ground, and a sun spread over pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sky(
    rng: np.random.Generator, rows: int = 64, sun: tuple[float, float] = (2.5, 6.0)
) -> NDArray[np.float32]:
    """A map `(rows, 2 * rows, 3)` whose first row is straight up; with a sun in most cases.

    `sun` bounds the deviation of its glow in degrees; its power does not depend on that.
    """
    theta = (np.arange(rows) + 0.5) / rows * np.pi
    phi = (np.arange(2 * rows) + 0.5) / rows * np.pi
    up = np.cos(theta)[:, None, None] * np.ones((1, 2 * rows, 1))
    zenith = np.array([0.25, 0.45, 0.9]) * rng.uniform(0.5, 1.5)
    horizon = np.array([0.9, 0.85, 0.8]) * rng.uniform(0.6, 1.5, 3)
    ground = np.array([0.25, 0.22, 0.18]) * rng.uniform(0.4, 1.2)
    picture = np.where(up > 0, zenith + (horizon - zenith) * (1 - np.clip(up, 0, 1)) ** 3, ground)
    if rng.random() < 0.7:
        height, around = np.radians(rng.uniform(15, 65)), rng.uniform(0, 2 * np.pi)
        towards = np.array(
            [np.cos(height) * np.cos(around), np.sin(height), np.cos(height) * np.sin(around)]
        )
        direction = np.stack(
            [
                np.sin(theta)[:, None] * np.cos(phi),
                up[..., 0],
                np.sin(theta)[:, None] * np.sin(phi),
            ],
            -1,
        )
        spread = np.radians(rng.uniform(*sun))
        angle = np.arccos(np.clip(direction @ towards, -1, 1))
        glow = np.exp(-0.5 * (angle / spread) ** 2)[..., None]
        warm = np.array([1.0, 0.6 + 0.35 * np.sin(height), 0.35 + 0.5 * np.sin(height)])
        picture = picture + glow * warm * rng.uniform(1.0, 2.5) / spread**2
    return (picture * 10 ** rng.uniform(-0.3, 0.7)).astype(np.float32)


def gradient(rng: np.random.Generator, rows: int = 64) -> NDArray[np.float32]:
    """A studio's map, `(rows, 2 * rows, 3)`: from one colour to another, with soft boxes."""
    up = np.linspace(0, 1, rows)[:, None, None] * np.ones((1, 2 * rows, 1))
    picture = rng.uniform(0.05, 1, 3) * (1 - up) + rng.uniform(0.02, 0.6, 3) * up
    row, column = np.mgrid[:rows, : 2 * rows]
    for _ in range(int(rng.integers(1, 5))):
        place, half = rng.uniform([0, 0], [0.6 * rows, 2 * rows]), rng.uniform(0.02, 0.15, 2) * rows
        around = np.abs((column - place[1] + rows) % (2 * rows) - rows)
        inside = (np.abs(row - place[0]) < half[0]) & (around < half[1])
        picture[inside] += rng.uniform(0.8, 1.2, 3) * 10 ** rng.uniform(0.3, 1.5)
    return (picture * 10 ** rng.uniform(-0.3, 0.5)).astype(np.float32)
