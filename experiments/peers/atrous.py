"""Edge-avoiding a-trous wavelets (Dammertz, Sewtz, Hanika, Lensch 2010)."""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments.peers.windows import over_offsets, square
from jflnr.frame import Array, Frame
from jflnr.images.guides import layers

# The paper leaves the widths to the user. These are those of its listing's order of magnitude,
# the colour's being halved at every level.
PAPER: dict[str, Any] = {"levels": 5, "colour": 4.0, "normal": 0.5, "position": 0.3}
TUNED: dict[str, Any] = {"levels": 5, "colour": 1e3, "normal": 0.5, "position": 0.1}

SPLINE = np.outer(*[np.array([1, 4, 6, 4, 1], np.float32) / 16] * 2).ravel()


def denoise(frame: Frame, *, levels: int, colour: float, normal: float, position: float) -> Array:
    """`levels` passes of a 5 x 5 B3 spline with holes, weighted by likeness. Returns `(H, W, 3)`.

    colour: standard width of the colour weight, in means of the noisy light. normal, position: of
    the others, position in typical depths of the scene. The frame needs `position`.
    """
    return _denoise(frame, levels, colour, normal, position)


@functools.partial(jax.jit, static_argnames="levels")
def _denoise(frame: Frame, levels: int, colour: float, normal: float, position: float) -> jax.Array:
    n, x = layers(frame, ("normal", "position"))
    light = jnp.asarray(frame.indirect)
    unit = jnp.mean(light)
    for level in range(levels):
        width = colour * unit / 2**level
        light = _pass(light, n / normal, x / position, width, 2**level)
    return light


def _pass(
    light: jax.Array, normal: jax.Array, position: jax.Array, width: jax.Array, step: int
) -> jax.Array:
    """One level; Eq. 2 to 4 of the paper."""
    here = (light / width, normal, position)
    inside = jnp.ones_like(light[..., :1])
    spline = jnp.asarray(SPLINE)

    def tap(sums: tuple[jax.Array, jax.Array], there: tuple, k: jax.Array) -> tuple:
        *features, value, exists = there
        distance = sum(
            jnp.sum((p - q) ** 2, axis=-1, keepdims=True)
            for p, q in zip(here, features, strict=True)
        )
        weight = spline[k] * jnp.exp(-distance) * exists
        return sums[0] + weight * value, sums[1] + weight

    start = (jnp.zeros_like(light), jnp.zeros_like(inside))
    total, weight = over_offsets(tap, start, (*here, light, inside), square(2, step))
    return total / weight
