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
    """Share of neighbours on the grid between which one surface ends and another begins."""
    found = jnp.concatenate([_ends(normal, depth, axis).ravel() for axis in (0, 1)])
    return jnp.sum(found) / max(found.size, 1)


def _ends(normal: jax.Array, depth: jax.Array, axis: int) -> jax.Array:
    """Where neighbours along an axis differ, one fewer along it; pixels that are not finite do."""
    if axis == 1:
        normal, depth = normal.swapaxes(0, 1), depth.T
    turn = jnp.sum((normal[1:] - normal[:-1]) ** 2, axis=-1)
    here, there = depth[:-1], depth[1:]
    return ~(turn <= TURN**2) | ~(jnp.abs(there - here) <= GAP * jnp.minimum(here, there))
