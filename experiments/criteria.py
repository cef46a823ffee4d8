"""What error a local model may have, told without a reference, from sums over its window.

All in numpy's float64 and for one channel, the brightness. Only `experiments.criterion` needs more
than one of them: jflnr itself decides by Mallows' (`jflnr/auto/nested.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jflnr.regression.moments import index_xx, index_xy


class Sums(NamedTuple):
    """Weighted sums over pixels of the products of regressors x, of x y and of y^2.

    xx: `(..., P, P)`. xy: `(..., P)`. yy: `(...)`. The first regressor is 1, so xx[..., 0, 0] is
    the weight of all pixels.
    """

    xx: np.ndarray
    xy: np.ndarray
    yy: np.ndarray

    def without(self, other: Sums) -> Sums:
        return Sums(*(a - b for a, b in zip(self, other, strict=True)))

    def order(self, regressors: int) -> Sums:
        """As if only the first regressors were there."""
        return Sums(self.xx[..., :regressors, :regressors], self.xy[..., :regressors], self.yy)


def sums_of(light: np.ndarray, squares: np.ndarray, guides: int) -> Sums:
    """From moments of the brightness `(K, h, w)` and its mean square `(h, w)`."""
    rows = range(guides + 1)
    xx = np.array([[index_xx(i, j) for j in rows] for i in rows])
    xy = np.array([index_xy(i, 0, guides, 1) for i in rows])
    planes = np.asarray(light, np.float64)
    return Sums(np.moveaxis(planes[xx], (0, 1), (-2, -1)), np.moveaxis(planes[xy], 0, -1), squares)


def solve(sums: Sums, ridge: float) -> np.ndarray:
    """The model of least squares, `(..., P)`. ridge: of the diagonal, a share of itself."""
    return np.linalg.solve(_regular(sums, ridge), sums.xy[..., None])[..., 0]


def freedom(sums: Sums, ridge: float) -> np.ndarray:
    """Effective degrees of freedom, the trace of the smoother."""
    return np.trace(np.linalg.solve(_regular(sums, ridge), sums.xx), axis1=-2, axis2=-1)


def _regular(sums: Sums, ridge: float) -> np.ndarray:
    diagonal = np.einsum("...ii->...i", sums.xx)
    floor = 1e-9 * diagonal[..., :1] + 1e-30
    return sums.xx + (ridge * diagonal + floor)[..., None] * np.eye(diagonal.shape[-1])


def residual(sums: Sums, model: np.ndarray) -> np.ndarray:
    """Weighted sum of (y - x model)^2."""
    fitted = np.einsum("...ij,...j->...i", sums.xx, model) - 2 * sums.xy
    return np.maximum(sums.yy + np.sum(model * fitted, axis=-1), 0)


def mean_residual(sums: Sums, model: np.ndarray) -> np.ndarray:
    """Weighted mean of (y - x model)^2, 0 where there is nothing."""
    return residual(sums, model) / np.maximum(sums.xx[..., 0, 0], 1e-12)


def gcv(mean_square: np.ndarray, freedom: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Generalised cross-validation (Craven and Wahba 1979).

    mean_square: of the residuals. count: effective number of pixels.
    """
    return mean_square / np.maximum(1 - freedom / np.maximum(count, 1), 1e-3) ** 2


def mallows(
    mean_square: np.ndarray, noise: np.ndarray, freedom: np.ndarray, count: np.ndarray
) -> np.ndarray:
    """Mallows' Cp, for a linear smoother Stein's unbiased estimate: expected squared error of the
    model plus the noise's variance. noise: that variance."""
    return mean_square + 2 * noise * freedom / np.maximum(count, 1)


def leave_out(sums: Sums, own: Sums, ridge: float) -> np.ndarray:
    """Mean squared error at the pixels of `own` of the model that is fitted to all others.

    The pixels are not read again: what they add to the sums is taken away.
    """
    return mean_residual(own, solve(sums.without(own), ridge))
