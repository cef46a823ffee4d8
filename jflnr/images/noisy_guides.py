"""Guides with noise of their own: ambient occlusion from few rays, and means of few samples."""

from __future__ import annotations

from typing import Any

from jflnr.lazy import jax, jnp, lax

# How far neighbours may differ, one standard deviation: normals, and depth as a share of itself.
NORMAL, DEPTH = 0.25, 0.02
# Normals that are a mean of several are shorter than 1; so many pixels of them are no accident.
SHORT, SHARE = 0.98, 1e-3
# Layers in half precision are added up that exactly, relative to them.
ROUNDING = 2e-3


def smooth_guide(guide: jax.Array, normal: jax.Array, depth: jax.Array) -> jax.Array:
    """Average a guide over 3 x 3 pixels of the same surface: along rows, then along columns.

    The fit would copy the noise of a guide into the picture. guide: `(H, W, Q)`. normal:
    `(H, W, 3)`. depth: `(H, W, 1)`. Returns `(H, W, Q)`.
    """
    normal, depth = jnp.asarray(normal), jnp.asarray(depth)
    for axis in (1, 0):
        guide = _smooth(guide, normal, depth, axis)
    return guide


def _smooth(guide: jax.Array, normal: jax.Array, depth: jax.Array, axis: int) -> jax.Array:
    weight = _likeness(normal, depth, axis)
    size = guide.shape[axis]
    difference = jnp.nan_to_num(jnp.diff(guide, axis=axis) * weight, posinf=0, neginf=0)
    margin = [(1, 1) if a == axis else (0, 0) for a in range(3)]
    change, weight = jnp.diff(jnp.pad(difference, margin), axis=axis), jnp.pad(weight, margin)
    after, before = (lax.slice_in_dim(weight, k, k + size, axis=axis) for k in (1, 0))
    return guide + change / (1 + after + before)


def _likeness(normal: jax.Array, depth: jax.Array, axis: int) -> jax.Array:
    """How alike each pixel and the next are, between 0 and 1, one fewer along `axis`; 0 for NaN."""
    size = depth.shape[axis]
    turn = jnp.sum(jnp.diff(normal, axis=axis) ** 2, axis=-1, keepdims=True)
    nearer = jnp.minimum(*(lax.slice_in_dim(depth, k, k + size - 1, axis=axis) for k in (0, 1)))
    step = jnp.diff(depth, axis=axis) / (DEPTH * nearer + 1e-6)
    return jnp.nan_to_num(jnp.exp(-(turn / NORMAL**2 + step**2) / 2))


def antialiased(normal: Any) -> Any:
    """Whether pixels hold a mean of several normals, `()`; those of a rasteriser hold one.

    A single sample anywhere in the pixel is not told from one at its centre. normal: `(H, W, 3)`,
    0 where nothing is hit.
    """
    xp: Any = normal.__array_namespace__()
    length = xp.sum(normal**2, axis=-1)
    return xp.mean((length > 1 - SHORT) & (length < SHORT)) > SHARE


def holds_light(albedo: Any, own: Any) -> Any:
    """Whether an albedo has emission and environment added to it, `()`. own: these, `(H, W, 3)`."""
    xp: Any = albedo.__array_namespace__()
    least = (1 - ROUNDING) * own - ROUNDING
    return ~xp.any((albedo < least) & xp.isfinite(albedo) & xp.isfinite(least))
