"""Nonlinearly Weighted First-Order Regression (Bitterli et al. 2016), an offline denoiser.

Two independent half buffers are needed. Each is regressed on the guides with non-local means
weights taken from the other half (section 4), reconstructed collaboratively (every model speaks for
its whole window), at two bandwidths out of which the better is chosen pixel by pixel from the
halves' mutual error (section 5). The guides have no noise here, so that the feature prefilter is
left out, as is the second filter pass over the result.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp

from experiments.peers.windows import box, over_offsets, square
from jflnr.regression.solve import cholesky_solve
from jflnr.frame import Array, Frame
from jflnr.guides import layers

PAPER: dict[str, Any] = {
    "guides": ("normal", "depth", "ao"),
    "radius": 9,
    "patch": 3,
    "bandwidths": (0.5, 1.0),
}
RIDGE = 1e-3


def denoise(
    frame: Frame,
    *,
    halves: tuple[tuple[Array, int], tuple[Array, int]],
    guides: tuple[str, ...],
    radius: int,
    patch: int,
    bandwidths: tuple[float, ...],
) -> Array:
    """NFOR of the demodulated light, `(H, W, 3)`.

    halves: two independent renderings `(H, W, 3)` with their samples per pixel; `frame.indirect` is
    not read. radius: of the window a model is fitted to. patch: radius of the patches compared.
    """
    (a, n_a), (b, n_b) = halves
    arrays = (jnp.asarray(a), jnp.asarray(b))
    return _denoise(frame, arrays, (n_a, n_b), guides, radius, patch, bandwidths)


@functools.partial(jax.jit, static_argnames=("spp", "guides", "radius", "patch", "bandwidths"))
def _denoise(
    frame: Frame,
    halves: tuple[jax.Array, jax.Array],
    spp: tuple[int, int],
    guides: tuple[str, ...],
    radius: int,
    patch: int,
    bandwidths: tuple[float, ...],
) -> jax.Array:
    x = jnp.concatenate(layers(frame, guides), axis=-1)
    x = (x - x.mean((0, 1))) / jnp.maximum(x.std((0, 1)), 1e-6)
    # Variance of one sample from two buffers, smoothed: one difference says little.
    squares = (halves[0] - halves[1]) ** 2 / (1 / spp[0] + 1 / spp[1])
    count = box(jnp.ones_like(squares[..., :1]), patch)
    one = box(squares, patch) / count
    variances = tuple(one / n for n in spp)

    share = spp[0] / sum(spp)
    results, errors = [], []
    for k in bandwidths:
        a = regress(halves[0], x, halves[1], variances[1], radius, patch, k)
        b = regress(halves[1], x, halves[0], variances[0], radius, patch, k)
        error = share * ((a - halves[1]) ** 2 - variances[1])
        error += (1 - share) * ((b - halves[0]) ** 2 - variances[0])
        results.append(share * a + (1 - share) * b)
        errors.append(box(error.mean(-1, keepdims=True), radius))
    best = jnp.argmin(jnp.stack(errors), axis=0)
    chosen = [(best == i).astype(x.dtype) for i in range(len(bandwidths))]
    # The choice is smoothed, so that it leaves no edges of its own.
    shares = [box(c, patch) / count for c in chosen]
    return sum((s * r for s, r in zip(shares, results, strict=True)), jnp.zeros_like(halves[0]))


def regress(
    target: jax.Array,
    x: jax.Array,
    other: jax.Array,
    variance: jax.Array,
    radius: int,
    patch: int,
    bandwidth: float,
) -> jax.Array:
    """First-order regression of `target` on x, weighted by likeness in `other`; `(H, W, 3)`."""
    height, width, count = x.shape
    offsets = square(radius)
    ones = jnp.ones_like(x[..., :1])
    side = box(ones, patch)

    def weight(other_q: jax.Array, variance_q: jax.Array, exists: jax.Array) -> jax.Array:
        noise = variance + jnp.minimum(variance, variance_q)
        scale = 1e-10 + bandwidth**2 * (variance + variance_q)
        distance = ((other - other_q) ** 2 - noise) / scale
        distance = box(distance.mean(-1, keepdims=True), patch) / side
        return jnp.exp(-jnp.maximum(distance, 0)) * exists

    def collect(sums: jax.Array, there: tuple, k: jax.Array) -> jax.Array:
        x_q, target_q, other_q, variance_q, exists = there
        w = weight(other_q, variance_q, exists)
        z = jnp.concatenate([exists, x_q - x], axis=-1)
        products = z[..., :, None] * jnp.concatenate([z, target_q], axis=-1)[..., None, :]
        return sums + w[..., None] * products

    images = (x, target, other, variance, ones)
    start = jnp.zeros((height, width, count + 1, count + 4), x.dtype)
    sums = jnp.moveaxis(over_offsets(collect, start, images, offsets), (2, 3), (0, 1))
    sums = sums / jnp.maximum(sums[:1, :1], 1e-6)
    ridge = jnp.diag(jnp.full(count + 1, RIDGE).at[0].set(0))[:, :, None, None]
    model = cholesky_solve(sums[:, : count + 1] + ridge, sums[:, count + 1 :])
    model = jnp.moveaxis(model.reshape(-1, height, width), 0, -1)

    def spread(sums: tuple, there: tuple, k: jax.Array) -> tuple:
        # The model of pixel q speaks about pixel p; weights are symmetric but for rounding.
        x_q, model_q, other_q, variance_q, exists = there
        w = weight(other_q, variance_q, exists)
        z = jnp.concatenate([jnp.ones_like(exists), x - x_q], axis=-1)
        guess = jnp.einsum("hwi,hwic->hwc", z, model_q.reshape(height, width, count + 1, 3))
        return sums[0] + w * guess, sums[1] + w

    images = (x, model, other, variance, ones)
    total, weights = over_offsets(
        spread, (jnp.zeros_like(target), jnp.zeros_like(ones)), images, offsets
    )
    return total / jnp.maximum(weights, 1e-6)
