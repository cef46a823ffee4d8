"""Adam (Kingma and Ba 2015), with an average of the weights."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

BETA1, BETA2 = 0.9, 0.99
# Longest gradient; share of each weight lost per step, times the step's size (Loshchilov and Hutter
# 2019); steps that the average looks back over, at most.
CLIP, DECAY, HORIZON = 1.0, 1e-4, 300.0


class Adam(NamedTuple):
    """params: the weights. mean, square: running moments of the gradient. average: running mean of
    the weights, which is what to use. step: how many were done."""

    params: Any
    mean: Any
    square: Any
    average: Any
    step: jax.Array


def start(params: Any) -> Adam:
    """The state before the first step."""
    params = jax.tree.map(jnp.asarray, params)
    zeros = jax.tree.map(jnp.zeros_like, params)
    return Adam(params, zeros, zeros, params, jnp.int32(0))


def update(state: Adam, gradient: Any, rate: jax.Array) -> Adam:
    """One step of size `rate`."""
    norm = jnp.sqrt(sum(jnp.sum(g**2) for g in jax.tree.leaves(gradient)))
    # A batch whose gradient overflowed is left out.
    factor = jnp.where(jnp.isfinite(norm), jnp.minimum(1, CLIP / (norm + 1e-12)), 0)
    gradient = jax.tree.map(lambda g: jnp.nan_to_num(g * factor), gradient)
    t = state.step + 1
    mean = jax.tree.map(lambda m, g: BETA1 * m + (1 - BETA1) * g, state.mean, gradient)
    square = jax.tree.map(lambda s, g: BETA2 * s + (1 - BETA2) * g**2, state.square, gradient)

    def move(p: jax.Array, m: jax.Array, s: jax.Array) -> jax.Array:
        direction = m / (1 - BETA1**t) / (jnp.sqrt(s / (1 - BETA2**t)) + 1e-8)
        return (p - rate * (direction + DECAY * p)).astype(p.dtype)

    params = jax.tree.map(move, state.params, mean, square)
    share = 1 / jnp.minimum(t + 1, HORIZON)
    average = jax.tree.map(lambda a, p: a + share * (p - a), state.average, params)
    return Adam(params, mean, square, average, t)
