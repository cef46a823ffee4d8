"""Whether a scene is simple, from a sparse grid of its pixels, before any pass over all of them."""

import jax
import jax.numpy as jnp

from jflnr.frame import Frame

# Pixels from one of the grid to the next.
STEP = 8
# Neighbours of the grid are on one surface if their normals and their depths differ by less, the
# depths as a share of the nearer one.
TURN, GAP = 0.3, 0.1
# A simple scene shows no more edges than this, and light that varies no more: its standard
# deviation in that of its mean, with the noise. Chosen on training frames (docs/select.md).
EDGES, SPREAD = 0.12, 4.0


@jax.jit
def is_simple(frame: Frame) -> jax.Array:
    """Whether large blocks will do: few edges, and no light so noisy that it hides the rest."""
    grid = slice(STEP // 2, None, STEP)
    light, normal, depth = (
        jnp.asarray(layer[grid, grid], jnp.float32)
        for layer in (frame.indirect, frame.normal, frame.depth)
    )
    return _is_calm(jnp.mean(light, axis=-1)) & (_edges(normal, depth[..., 0]) <= EDGES)


def _is_calm(light: jax.Array) -> jax.Array:
    known = jnp.isfinite(light)
    light = jnp.where(known, light, 0)
    light /= jnp.maximum(jnp.max(light, initial=0), 1e-30)  # squares of the brightest may overflow
    count = jnp.maximum(jnp.sum(known), 1)
    mean = jnp.sum(light) / count
    return jnp.sum(jnp.where(known, light - mean, 0) ** 2) <= count * (SPREAD * mean) ** 2


def _edges(normal: jax.Array, depth: jax.Array) -> jax.Array:
    """Share of neighbours on the grid between which one surface ends and another begins; pixels
    that are not finite are no surface."""
    found = []
    for n, d in ((normal, depth), (normal.swapaxes(0, 1), depth.T)):
        turn, here, there = jnp.sum((n[1:] - n[:-1]) ** 2, axis=-1), d[:-1], d[1:]
        step = jnp.abs(there - here)
        found.append(~(turn <= TURN**2) | ~(step <= GAP * jnp.minimum(here, there)))
    ends = jnp.concatenate([some.ravel() for some in found])
    return jnp.sum(ends) / max(ends.size, 1)
