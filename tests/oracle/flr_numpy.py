"""FLR by plain loops in numpy float64: one weighted least squares per block, nothing shared.

Written from the paper's Eq. 4-9 and Appendix, not from jflnr's code: the window is a weight per
pixel, means and covariances are taken about the window's own mean, and the solve is numpy's.
"""

import numpy as np


def flr(target, guides, sigma, eps, eps_prime, block=8, weight=None, guides_map=None):
    target, guides = np.float64(target), np.float64(guides)
    height, width, channels = target.shape
    rows, columns = -(-height // block), -(-width // block)
    weight = np.ones((height, width)) if weight is None else np.float64(weight)
    block_y, block_x = np.arange(height) // block, np.arange(width) // block
    models = np.zeros((rows, columns, guides.shape[2] + 1, channels))
    for i in range(rows):
        for j in range(columns):
            distance = (block_y[:, None] - i) ** 2 + (block_x[None] - j) ** 2
            window = weight * np.exp(-0.5 * distance * (block / sigma) ** 2)
            models[i, j] = one_window(
                guides.reshape(height * width, -1),
                target.reshape(height * width, -1),
                window.reshape(-1),
                eps,
                eps_prime,
            )
    return evaluate(models, guides if guides_map is None else np.float64(guides_map), block, target)


def one_window(x, y, w, eps, eps_prime):
    """Intercept and slopes `(Q + 1, C)` of one window (Appendix, Eq. 12-23)."""
    if w.sum() == 0:
        return np.zeros((x.shape[1] + 1, y.shape[1]))
    w = w / w.sum()
    mean_x, mean_y = w @ x, w @ y
    covariance = (x - mean_x).T @ (w[:, None] * (x - mean_x))
    regular = covariance + eps * (np.outer(mean_x, mean_x) + np.diag(mean_x**2))
    regular += eps_prime * np.eye(len(mean_x))
    scale = np.sqrt(np.diag(regular))
    correlation = regular / np.outer(scale, scale) + eps_prime * np.eye(len(mean_x))
    right = (x - mean_x).T @ (w[:, None] * (y - mean_y)) / scale[:, None]
    slopes = np.linalg.solve(correlation, right) / scale[:, None]
    return np.vstack([mean_y - mean_x @ slopes, slopes])


def evaluate(models, guides, block, target):
    """Bilinear interpolation of the models between block centres, by its definition."""
    step = block * -(-guides.shape[0] // target.shape[0])
    height, width = guides.shape[:2]
    out = np.zeros((height, width, models.shape[-1]))
    for py in range(height):
        for px in range(width):
            y = np.clip((py + 0.5) / step - 0.5, 0, models.shape[0] - 1)
            x = np.clip((px + 0.5) / step - 0.5, 0, models.shape[1] - 1)
            model = 0
            for i in {int(y), min(int(y) + 1, models.shape[0] - 1)}:
                for j in {int(x), min(int(x) + 1, models.shape[1] - 1)}:
                    model = model + (1 - abs(y - i)) * (1 - abs(x - j)) * models[i, j]
            out[py, px] = np.concatenate([[1], guides[py, px]]) @ model
    return out
