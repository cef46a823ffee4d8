"""FLR with the paper's Eq. 11, which it calls worse, in place of its normalised form."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.frame import Array, Frame
from jflnr.images import guides
from jflnr.regression.apply import apply
from jflnr.regression.blur import blur
from jflnr.regression.elimination import cholesky_solve
from jflnr.regression.flr import DEFAULT
from jflnr.regression.moments import collect, index_xx, index_xy

BLOCK, SUPPORT = DEFAULT.block, 72


def denoise(frame: Frame, *, eps: float) -> Array:
    """`(X^T X + eps I)^-1 X^T Y`, where the window's weights sum to 1; `(H, W, 3)`."""
    return _denoise(frame, eps)


@jax.jit
def _denoise(frame: Frame, eps: jax.Array) -> jax.Array:
    layers = guides.layers(frame, guides.DEFAULT)
    # Moments about zero: the equation as it stands.
    shift = jnp.zeros(sum(layer.shape[-1] for layer in layers), layers[0].dtype)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0] > 0
    moments = collect(jnp.asarray(frame.indirect), layers, shift, BLOCK, weight)
    moments = blur(moments, DEFAULT.sigma / BLOCK, reach=SUPPORT // BLOCK)
    return apply(solve(moments, shift.size + 1, eps), layers, shift, BLOCK)


def solve(moments: jax.Array, size: int, eps: jax.Array) -> jax.Array:
    """Models from moments of `size` regressors, the constant among them, and three channels."""
    pairs = np.array([index_xx(i, j) for i, j in np.ndindex(size, size)]).reshape(size, size)
    cross = np.array([index_xy(i, c, size - 1, 3) for i, c in np.ndindex(size, 3)])
    ridge = eps * jnp.eye(size, dtype=moments.dtype)[:, :, None, None]
    return cholesky_solve(moments[pairs] + ridge, moments[cross.reshape(size, 3)])
