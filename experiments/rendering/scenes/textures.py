"""Procedural pictures of materials: reflectances `(256, 256, 3)`, linear, that tile seamlessly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
SIZE = 256


def _coordinates() -> tuple[Array, Array]:
    c = (np.arange(SIZE) + 0.5) / SIZE
    y, x = np.meshgrid(c, c, indexing="ij")
    return x, y


def noise(rng: np.random.Generator, low: float, high: float, stretch: float = 1.0) -> Array:
    """Tiling noise `(256, 256)` of mean 0, deviation 1: frequencies low..high cycles a tile."""
    fy = np.fft.fftfreq(SIZE)[:, None] * SIZE * stretch
    fx = np.fft.fftfreq(SIZE)[None] * SIZE
    f = np.hypot(fx, fy)
    spectrum = np.where((f >= low) & (f <= high), 1 / np.maximum(f, 1), 0)
    phase = np.exp(2j * np.pi * rng.random((SIZE, SIZE)))
    field = np.fft.ifft2(spectrum * phase).real
    return field / max(float(field.std()), 1e-9)


def _mix(a: ArrayLike, b: ArrayLike, share: Array) -> Array:
    share = np.clip(share, 0, 1)[..., None]
    return np.asarray(a, float) * (1 - share) + np.asarray(b, float) * share


def _contrast(rng: np.random.Generator, colour: Array) -> Array:
    """A darker or a lighter relative of a colour."""
    return np.clip(colour * rng.uniform(0.25, 0.7) + rng.uniform(0, 0.05, 3), 0.01, 0.9)


def plaster(rng: np.random.Generator, colour: Array) -> Array:
    return colour * (1 + 0.04 * noise(rng, 1, 8) + 0.02 * noise(rng, 20, 100))[..., None]


def planks(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    rows = int(rng.integers(4, 9))
    row = np.floor(y * rows).astype(int)
    shift = rng.random(rows)
    board = np.floor((x + shift[row]) % 1 * 2).astype(int)
    tone = rng.uniform(0.65, 1.15, (rows, 2))[row, board]
    grain = 1 + 0.12 * noise(rng, 2, 90, 0.08) + 0.05 * noise(rng, 30, 120, 0.05)
    gap = (np.abs(y * rows % 1 - 0.5) > 0.47) | (np.abs((x + shift[row]) * 2 % 1 - 0.5) > 0.495)
    return colour * (tone * grain * np.where(gap, 0.35, 1.0))[..., None]


def tiles(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    n = int(rng.integers(2, 6))
    tone = rng.uniform(0.85, 1.1, (n, n))[(y * n).astype(int), (x * n).astype(int)]
    joint = np.maximum(np.abs(x * n % 1 - 0.5), np.abs(y * n % 1 - 0.5)) > 0.5 - 0.02 * n / 4
    return _mix(colour[None, None] * tone[..., None], [0.35, 0.34, 0.32], joint.astype(float))


def checks(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    n = 2 * int(rng.integers(1, 4))
    odd = ((x * n).astype(int) + (y * n).astype(int)) % 2
    return _mix(colour, _contrast(rng, colour), odd.astype(float)) * (
        1 + 0.05 * noise(rng, 2, 40)[..., None]
    )


def bricks(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    rows, columns = 8, 4
    row = (y * rows).astype(int)
    u = (x * columns + 0.5 * (row % 2)) % columns
    tone = rng.uniform(0.6, 1.2, (rows, columns))[row, u.astype(int)]
    joint = (np.abs(u % 1 - 0.5) > 0.47) | (np.abs(y * rows % 1 - 0.5) > 0.43)
    body = colour * (tone * (1 + 0.12 * noise(rng, 4, 100)))[..., None]
    return _mix(body, [0.5, 0.48, 0.45], joint.astype(float))


def stripes(rng: np.random.Generator, colour: Array) -> Array:
    x, _ = _coordinates()
    n = int(rng.integers(3, 12))
    band = 0.5 + 0.5 * np.sign(np.sin(2 * np.pi * n * x) - rng.uniform(-0.5, 0.7))
    return _mix(colour, _contrast(rng, colour), band)


def woven(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    thread = 0.5 + 0.25 * (np.sin(2 * np.pi * 64 * x) + np.sin(2 * np.pi * 64 * y))
    return _mix(colour, _contrast(rng, colour), 0.6 * thread + 0.15 * noise(rng, 2, 20))


def marble(rng: np.random.Generator, colour: Array) -> Array:
    vein = np.abs(noise(rng, 1, 12) + 0.3 * noise(rng, 10, 60))
    return _mix(_contrast(rng, colour), colour, vein * 2.5)


def rug(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    d = np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) * 2
    level = np.digitize(d, np.sort(rng.uniform(0.15, 0.97, 6)))
    palette = np.clip(
        colour * rng.uniform(0.3, 1.6, (7, 1)) + rng.uniform(-0.1, 0.2, (7, 3)), 0.02, 0.85
    )
    diamond = (np.abs(x * 8 % 1 - 0.5) + np.abs(y * 8 % 1 - 0.5) < 0.3) & (level % 2 == 0)
    picture = palette[level]
    picture[diamond] = palette[(level[diamond] + 1) % 7]
    return picture * (1 + 0.08 * noise(rng, 20, 120)[..., None])


def painting(rng: np.random.Generator, colour: Array) -> Array:
    x, y = _coordinates()
    picture = _mix(rng.uniform(0.05, 0.8, 3), colour, y + 0.2 * noise(rng, 1, 6))
    for _ in range(int(rng.integers(3, 9))):
        cx, cy, r = rng.random(), rng.random(), rng.uniform(0.05, 0.3)
        inside = np.hypot(x - cx, (y - cy) * rng.uniform(0.5, 2)) + 0.03 * noise(rng, 2, 12) < r
        picture[inside] = rng.uniform(0.03, 0.85, 3)
    return picture


def earth(rng: np.random.Generator, colour: Array) -> Array:
    blotch = 0.5 + 0.4 * noise(rng, 1, 10) + 0.25 * noise(rng, 10, 120)
    return _mix(_contrast(rng, colour), colour, blotch)


Texture = Callable[[np.random.Generator, Array], Array]
WALLS: tuple[Texture, ...] = (plaster, plaster, bricks, stripes, tiles, marble)
FLOORS: tuple[Texture, ...] = (planks, planks, tiles, checks, woven, marble)
FABRICS: tuple[Texture, ...] = (woven, stripes, checks, plaster)


def limited(picture: Array) -> NDArray[np.float32]:
    """Reflectances kept within 0.01..0.92, as real diffuse surfaces are."""
    return np.clip(picture, 0.01, 0.92).astype(np.float32)
