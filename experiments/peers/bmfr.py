"""Blockwise Multi-Order Feature Regression (Koskela et al. 2019), its single-frame form.

No temporal accumulation and no TAA: the regression of jflnr/bmfr/fit.py, on features that
can be chosen, with several grids of blocks averaged.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from jflnr.bmfr.fit import fit
from jflnr.frame import Array, Frame
from jflnr.images.guides import layers

PAPER: dict[str, Any] = {
    "features": ("normal", "position", "position2"),
    "block": 32,
    "noise": 0.01,
    "grids": 1,
}
TUNED: dict[str, Any] = {
    "features": ("normal", "position", "position2"),
    "block": 64,
    "noise": 0.1,
    "grids": 4,
}


@functools.partial(jax.jit, static_argnames=("features", "block", "grids"))
def denoise(
    frame: Frame, *, features: tuple[str, ...], block: int, noise: float, grids: int
) -> Array:
    """Least squares in every block on noisy features, evaluated on the clean ones (section 3.4).

    features: layers of the frame; `position2`, the squares of the position, comes last. block:
    pixels on a side. noise: half width of the uniform noise on features scaled to [-1, 1]. grids:
    how many displaced grids of blocks are averaged; the paper displaces one grid per frame and
    averages over time.
    Returns `(H, W, 3)`.
    """
    names = [name for name in features if name != "position2"]
    x = jnp.concatenate(layers(frame, names), axis=-1)
    y = jnp.asarray(frame.indirect)
    surface = jnp.ones_like(y[..., :1], bool)
    squares = 3 * ("position2" in features)
    # Displacements along a diagonal and its mirror: (0, 0), (1/2, 1/2), (1/4, 3/4), ...
    down = jnp.asarray([0, block // 2, block // 4, 3 * block // 4])[jnp.arange(grids) % 4]
    offsets = jnp.stack([down, -down % block], axis=-1)

    def fitted(grid: tuple[jax.Array, jax.Array]) -> jax.Array:
        return fit(y, x, surface, *grid, block=block, noise=noise, squares=squares)

    total = jnp.sum(jax.lax.map(fitted, (jnp.arange(grids), offsets)), axis=0)
    return jnp.maximum(total / grids, 0)
