"""Ways to solve the same windowed least squares, in numpy, in the arithmetic they are given.

Each takes a `Window` and returns the models `(B, Q + 1, C)` of its B blocks, for the regressors
[1, X]. They fail as their textbook forms fail: nothing is guarded that its source does not guard.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jflnr.regression.flr import DEFAULT

TIKHONOV = 1e-6
NOISE = 0.01  # amplitude of BMFR's stochastic regularisation, of guides scaled to [-1, 1]
EPS, EPS_PRIME = float(DEFAULT.eps), float(DEFAULT.eps_prime)


class Window(NamedTuple):
    """x: `(N, Q)`, y: `(N, C)`, w: `(B, N)` weights with sum 1, one row per block; one dtype."""

    x: np.ndarray
    y: np.ndarray
    w: np.ndarray


def _moments(window: Window) -> tuple[np.ndarray, np.ndarray]:
    """[1, X]^T [1, X] `(B, P, P)` and [1, X]^T Y `(B, P, C)`, as in Eq. 9."""
    z = np.concatenate([np.ones_like(window.x[:, :1]), window.x], 1)
    (n, p), c = z.shape, window.y.shape[1]
    xx = window.w @ (z[:, :, None] * z[:, None]).reshape(n, p * p)
    xy = window.w @ (z[:, :, None] * window.y[:, None]).reshape(n, p * c)
    return xx.reshape(-1, p, p), xy.reshape(-1, p, c)


def _each(
    function: Callable[[np.ndarray, np.ndarray], np.ndarray], a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """Block by block; NaN where the library says that the matrix is singular."""
    out = np.full_like(b, np.nan)
    for i in range(len(a)):
        try:
            out[i] = function(a[i], b[i])
        except np.linalg.LinAlgError:
            continue
    return out


def inverse(window: Window) -> np.ndarray:
    """Eq. 7 as printed: the inverse of the normal equations."""
    return _each(lambda a, b: np.linalg.inv(a) @ b, *_moments(window))


def lu(window: Window) -> np.ndarray:
    """The normal equations by LU with partial pivoting."""
    return _each(np.linalg.solve, *_moments(window))


def tikhonov(window: Window) -> np.ndarray:
    """Eq. 11 as in Figure 3."""
    xx, xy = _moments(window)
    return _each(np.linalg.solve, xx + np.asarray(TIKHONOV, xx.dtype) * np.eye(xx.shape[1]), xy)


def tikhonov_exact(window: Window) -> np.ndarray:
    """The same by least squares on the pixels with sqrt(eps) I below them, for use in float64."""
    z = np.concatenate([np.ones_like(window.x[:, :1]), window.x], 1)
    p, models = z.shape[1], []
    for w in np.sqrt(window.w)[:, :, None]:
        a = np.concatenate([w * z, TIKHONOV**0.5 * np.eye(p)])
        length = np.linalg.norm(a, axis=0)
        q, r = np.linalg.qr(a / length)
        b = np.concatenate([w * window.y, np.zeros((p, window.y.shape[1]))])
        models.append(np.linalg.solve(r, q.T @ b) / length[:, None])
    return np.stack(models)


def paper(window: Window) -> np.ndarray:
    """The Appendix: Eq. 12-23 from plain moments, then the recursive block inverse."""
    xx, xy = _moments(window)
    eps, eps_prime = (np.asarray(v, xx.dtype) for v in (EPS, EPS_PRIME))
    eye = np.eye(xx.shape[1] - 1, dtype=xx.dtype)
    mean_x, mean_y = xx[:, 0, 1:], xy[:, 0]
    outer = mean_x[:, :, None] * mean_x[:, None]
    regular = xx[:, 1:, 1:] - outer + eps * (outer + outer * eye) + eps_prime * eye
    sigma = np.sqrt(np.diagonal(regular, axis1=1, axis2=2))
    correlation = regular / (sigma[:, :, None] * sigma[:, None])
    right = (xy[:, 1:] - mean_x[:, :, None] * mean_y[:, None]) / sigma[:, :, None]
    slopes = _block_inverse(correlation + eps_prime * eye) @ right / sigma[:, :, None]
    value = mean_y - np.einsum("bq,bqc->bc", mean_x, slopes)
    return np.concatenate([value[:, None], slopes], 1)


def _block_inverse(m: np.ndarray) -> np.ndarray:
    """The first formula of the Appendix, `(B, Q, Q)`."""
    if m.shape[1] == 1:
        return 1 / m
    h = m.shape[1] // 2
    a, b, c, d = m[:, :h, :h], m[:, :h, h:], m[:, h:, :h], m[:, h:, h:]
    a_inverse = _block_inverse(a)
    schur = _block_inverse(d - c @ a_inverse @ b)
    right = -a_inverse @ b @ schur
    left = -schur @ c @ a_inverse
    top = np.concatenate([a_inverse - right @ c @ a_inverse, right], 2)
    return np.concatenate([top, np.concatenate([left, schur], 2)], 1)


def householder(window: Window) -> np.ndarray:
    """BMFR's factorisation (its section 3.4) of [X, y], then back substitution, no pivoting."""
    return _qr(window, 0)


def householder_noise(window: Window) -> np.ndarray:
    """The same with stochastic regularisation: noise on the scaled guides (its Eq. 7)."""
    return _qr(window, NOISE)


def _qr(window: Window, noise: float) -> np.ndarray:
    x, low, span = _scaled(window.x)
    random = np.random.default_rng(0).uniform(-noise, noise, x.shape).astype(x.dtype)
    root = np.sqrt(window.w)[:, :, None]
    z = np.concatenate([np.ones_like(x[:, :1]), x + random], 1)
    whole = root * np.concatenate([z, window.y], 1)
    if not np.isfinite(whole).all():
        return np.full((len(window.w), z.shape[1], window.y.shape[1]), np.nan, x.dtype)
    r: np.ndarray = np.linalg.qr(whole, mode="r")  # type: ignore[assignment]
    p = z.shape[1]
    solution = r[:, :p, p:].copy()
    for i in reversed(range(p)):
        solution[:, i] -= np.einsum("bj,bjc->bc", r[:, i, i + 1 : p], solution[:, i + 1 :])
        solution[:, i] /= r[:, i, i, None]
    return _unscaled(solution, low, span)


def svd(window: Window) -> np.ndarray:
    """Least squares by singular values, smallest solution where there are many."""
    x, low, span = _scaled(window.x)
    root = np.sqrt(window.w)[:, :, None]
    z = root * np.concatenate([np.ones_like(x[:, :1]), x], 1)
    if not np.isfinite(z).all():
        return np.full((len(root), z.shape[2], window.y.shape[1]), np.nan, x.dtype)
    # Of the triangle, which has the same singular values and is much smaller.
    q, r = np.linalg.qr(z)
    u, s, v = np.linalg.svd(r)
    kept = s > s[:, :1] * z.shape[1] * np.finfo(s.dtype).eps
    reciprocal = np.divide(1, s, where=kept, out=np.zeros_like(s))
    right = u.swapaxes(1, 2) @ (q.swapaxes(1, 2) @ (root * window.y))
    return _unscaled(v.swapaxes(1, 2) @ (reciprocal[:, :, None] * right), low, span)


def _scaled(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The guides in [-1, 1], as BMFR scales them; a constant one becomes -1."""
    low, high = x.min(0, initial=np.inf), x.max(0, initial=-np.inf)
    span = np.where(high > low, high - low, 1)
    return 2 * ((x - low) / span) - 1, low, span


def _unscaled(solution: np.ndarray, low: np.ndarray, span: np.ndarray) -> np.ndarray:
    slopes = 2 * solution[:, 1:] / span[:, None]
    value = solution[:, 0] - solution[:, 1:].sum(1) - np.einsum("q,bqc->bc", low, slopes)
    return np.concatenate([value[:, None], slopes], 1)


def exact(window: Window) -> np.ndarray:
    """The regularised problem of Eq. 18-23, about the window's mean, for use in float64."""
    models = []
    for w in window.w:
        mean_x, mean_y = w @ window.x, w @ window.y
        x, y = window.x - mean_x, window.y - mean_y
        weighted = w[:, None] * x
        regular = weighted.T @ x + EPS * (np.outer(mean_x, mean_x) + np.diag(mean_x**2))
        regular += EPS_PRIME * np.eye(len(mean_x))
        scale = np.sqrt(np.diag(regular))
        correlation = regular / scale[:, None] / scale + EPS_PRIME * np.eye(len(mean_x))
        slopes = np.linalg.solve(correlation, weighted.T @ y / scale[:, None]) / scale[:, None]
        models.append(np.concatenate([(mean_y - mean_x @ slopes)[None], slopes]))
    return np.stack(models)
