"""Adam (Kingma and Ba 2015) as a stochastic solver of jaxopt, with an average of the weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxopt._src import base
from jaxopt.tree_util import tree_l2_norm


class AdamState(NamedTuple):
    """iter_num: steps done. value: loss before the last one. error: norm of its gradient.

    mean, square: running moments of the gradient. average: running mean of the parameters,
    which is what to use.
    """

    iter_num: jax.Array
    value: jax.Array
    error: jax.Array
    mean: Any
    square: Any
    average: Any


@dataclass(eq=False)
class Adam(base.StochasticSolver):
    """Adaptive step sizes; decay of the weights apart from them (Loshchilov and Hutter 2019).

    fun: `fun(params, data) -> loss`. stepsize: from the step's number. clip: longest gradient.
    decay: share of each weight lost per step, times the step size. horizon: steps that the
    average looks back over, at most.
    """

    fun: Callable[..., jax.Array]
    stepsize: Callable[[jax.Array], jax.Array]
    beta1: float = 0.9
    beta2: float = 0.99
    clip: float = 1.0
    decay: float = 0.0
    horizon: float = 300.0
    maxiter: int = 1000
    tol: float = 0.0
    jit: bool = True
    implicit_diff: bool = False
    implicit_diff_solve: Callable | None = None
    verbose: bool = False
    unroll: bool = False

    def init_state(self, init_params: Any, *args: Any, **kwargs: Any) -> AdamState:
        """The state before the first step."""
        zeros = jax.tree.map(jnp.zeros_like, init_params)
        infinite = jnp.asarray(jnp.inf, jnp.float32)
        return AdamState(jnp.asarray(0), infinite, infinite, zeros, zeros, init_params)

    def update(self, params: Any, state: AdamState, *args: Any, **kwargs: Any) -> base.OptStep:
        """One step on one batch: `update(params, state, data=batch)`."""
        value, gradient = jax.value_and_grad(self.fun)(params, *args, **kwargs)
        norm = tree_l2_norm(gradient)
        # A batch whose gradient overflowed is left out.
        factor = jnp.where(jnp.isfinite(norm), jnp.minimum(1, self.clip / (norm + 1e-12)), 0)
        gradient = jax.tree.map(lambda g: jnp.nan_to_num(g * factor), gradient)
        t = state.iter_num + 1
        b1, b2 = self.beta1, self.beta2
        mean = jax.tree.map(lambda m, g: b1 * m + (1 - b1) * g, state.mean, gradient)
        square = jax.tree.map(lambda s, g: b2 * s + (1 - b2) * g**2, state.square, gradient)
        step = self.stepsize(state.iter_num)

        def move(p: jax.Array, m: jax.Array, s: jax.Array) -> jax.Array:
            direction = m / (1 - b1**t) / (jnp.sqrt(s / (1 - b2**t)) + 1e-8)
            return (p - step * (direction + self.decay * p)).astype(p.dtype)

        params = jax.tree.map(move, params, mean, square)
        rate = 1 / jnp.minimum(t + 1, self.horizon)
        average = jax.tree.map(lambda a, p: a + rate * (p - a), state.average, params)
        return base.OptStep(params, AdamState(t, value, norm, mean, square, average))
