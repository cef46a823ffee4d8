"""One check of any function's derivatives, along a random direction."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree


def agree(function, *point, step=1e-4, forward_tolerance=1e-7, reverse_tolerance=1e-9, seed=0):
    """Forward mode against Richardson's extrapolation of differences, reverse against forward mode.

    In float64. point: pytrees of numbers and arrays of order 1; the direction is normal in all of
    them. step: of the smaller difference. The tolerances are relative to the largest derivative.
    """
    rng = np.random.default_rng(seed)
    with jax.enable_x64(True):
        point = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), point)
        direction = jax.tree.map(lambda a: jnp.asarray(rng.standard_normal(a.shape)), point)

        def flat(point):
            return ravel_pytree(function(*point))[0]

        back = rng.standard_normal(jax.eval_shape(flat, point).shape)

        @jax.jit
        def both(point):
            value, forward = jax.jvp(flat, (point,), (direction,))
            gradient = jax.vjp(flat, point)[1](jnp.asarray(back))[0]
            along = jax.tree.map(jnp.vdot, gradient, direction)
            return value, forward, sum(jax.tree.leaves(along))

        def central(h):
            ends = [jax.tree.map(lambda a, d, s=s: a + s * d, point, direction) for s in (h, -h)]
            return (both(ends[0])[0] - both(ends[1])[0]) / (2 * h)

        richardson = (4 * central(step) - central(2 * step)) / 3
        _, forward, by_reverse = both(point)
    scale = np.abs(forward).max() + 1e-6
    np.testing.assert_allclose(forward, richardson, atol=forward_tolerance * scale)
    by_forward = np.vdot(back, forward)
    atol = reverse_tolerance * scale * np.sqrt(back.size)
    np.testing.assert_allclose(by_reverse, by_forward, atol=atol, rtol=reverse_tolerance)
