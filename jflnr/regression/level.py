"""One level of the pyramid: local models at one window width, and how noisy they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jflnr.lazy import jax, jnp
from jflnr.regression.division import divide
from jflnr.regression.moments import index_xx, index_xy
from jflnr.regression.resampling import halve
from jflnr.regression.solve import solve_strips
from jflnr.regression.window import Window, gather, gather_moments, window_over

if TYPE_CHECKING:
    from jflnr.regression.adaptive import AdaptiveFLR


class Grid(NamedTuple):
    """What is collected at one size of block.

    moments: `(K, h, w)`, weighted. noise: `(1, h, w)`, mean of the squared weighted residuals of
    the brightness. block: the block's side in pixels.
    """

    moments: jax.Array
    noise: jax.Array
    block: int

    def pyramid(self, levels: int) -> list[Grid]:
        """This grid and coarser ones, each of half the resolution."""
        grids = [self]
        for _ in range(levels - 1):
            last = grids[-1]
            grids.append(Grid(halve(last.moments), halve(last.noise), 2 * last.block))
        return grids


class Fit(NamedTuple):
    """The models of one level.

    coefficients: `(Q + 1, C, h, w)`. variance: `(h, w)`, of the brightness they predict.
    window: the window they were fitted under.
    """

    coefficients: jax.Array
    variance: jax.Array
    window: Window


def brightness(channels: int, dtype: Any) -> Any:
    """Weights `(C,)` of the channels in the brightness by which all of them are treated.

    Luminance of linear sRGB for colours, or for several light groups of three channels, whose sum
    counts; else the sum.
    """
    luminance = (0.2126, 0.7152, 0.0722)
    weights = luminance * (channels // 3) if channels % 3 == 0 else (1,) * channels
    return np.asarray(weights, dtype)


def mean_guides(moments: jax.Array, guides: int) -> jax.Array:
    """Each block's mean of [1, X - shift], `(Q + 1, h, w)`; [1, 0, ...] where it is empty."""
    planes = moments[np.array([index_xx(i, 0) for i in range(guides + 1)])]
    return (planes * divide(1, moments[:1], 1e-12)).at[0].set(1)


def predict(coefficients: jax.Array, regressors: jax.Array) -> jax.Array:
    """Brightness of the models at one point per block.

    coefficients: `(Q + 1, C, h, w)`. regressors: `(Q + 1, h, w)`. Returns `(h, w)`.
    """
    weights = brightness(coefficients.shape[1], coefficients.dtype)
    return jnp.einsum("qchw,qhw,c->hw", coefficients, regressors, weights)


def guide_features(grid: Grid, guides: int, numbers: AdaptiveFLR) -> jax.Array:
    """What of the guides must be alike inside a window, `(Q, h, w)`."""
    return numbers.guide_scale * mean_guides(grid.moments, guides)[1:]


def fit_level(
    grid: Grid,
    shift: jax.Array,
    channels: int,
    mean: jax.Array,
    numbers: AdaptiveFLR,
    features: jax.Array | None = None,
    *,
    slopes: bool = True,
) -> Fit:
    """The models of one level, of the guides alone.

    The variance of a weighted mean, sum(w^2 r^2) / sum(w)^2 with residuals r, tells how noisy the
    window's brightness is. The regularisation grows with it: where the signal drowns, slopes go.

    mean: brightness of the whole frame. features: `(F, h, w)`, what must be alike in a window; that
    of the guides if None. slopes: whether the position in the window is fitted as a guide too.
    """
    guides, positions = shift.size, 2 if slopes else 0
    if features is None:
        features = guide_features(grid, guides, numbers)
    window = window_over(features, numbers.sigma)
    if slopes:
        given = window, numbers.sigma, guides, channels, numbers.position_ridge
        moments = gather_moments(grid.moments, *given)
    else:
        moments = gather(grid.moments, window)
    n = jnp.maximum(moments[0], 1e-12)
    # The square of n and, in derivatives, the square of that would be too small for float32.
    inverse = 1 / (n * grid.block)
    variance = gather(grid.noise, window.squared())[0] * inverse * inverse
    start = index_xy(0, 0, guides + positions, channels)
    colour = moments[start : start + channels] / n
    luminance = jnp.einsum("chw,c->hw", colour, brightness(channels, n.dtype))
    # The mean's square may be beyond float32.
    relative = variance / (jnp.maximum(luminance, 0) ** 2 + 0.01 * mean**2 + 1e-30)
    ridge = jnp.minimum(numbers.noise_ridge * relative, 1)

    # Positions are centred on the window already, so only their own ridge, above, is added.
    centred = jnp.concatenate([shift, jnp.zeros(positions, shift.dtype)])
    regular = numbers.eps + ridge, numbers.eps_prime + ridge
    coefficients = solve_strips(moments, centred, *regular, channels)
    return Fit(coefficients[: guides + 1], variance, window)
