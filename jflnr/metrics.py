"""How far an image is from its reference: the one definition for commands and experiments.

Picture metrics (PSNR, SSIM, FLIP) are taken on `display` of reflected radiance `albedo * indirect`
against `albedo * reference`; rMSE, SMAPE and the squared errors on that radiance itself.
"""

from typing import Any

import numpy as np

from jflnr import checks
from jflnr.frame import Array, Frame

MEAN_BRIGHTNESS = 0.35
GAMMA = 2.2
# rMSE divides by the squared reference plus this share of its squared mean, so that neither black
# pixels nor the scene's unit of light matter.
RELATIVE_EPSILON = 1e-2
# How reports name them.
LABELS = {
    "psnr": "PSNR dB",
    "ssim": "SSIM",
    "flip": "FLIP",
    "rmse": "rMSE",
    "smape": "SMAPE",
    "mse": "MSE",
    "mse_unbiased": "MSE unbiased",
}


def exposure(reference: np.ndarray) -> float:
    """The factor that brings the mean of a linear picture to 0.35; 1 for a black one."""
    mean = float(np.mean(reference, dtype=np.float64))
    return MEAN_BRIGHTNESS / mean if mean > 0 else 1.0


def display(picture: np.ndarray, scale: float) -> np.ndarray:
    """Linear radiance (H, W, 3) as shown on a screen: scaled, clipped to [0, 1], gamma 2.2."""
    return np.clip(picture * scale, 0, 1) ** (1 / GAMMA)


def reflected(frame: Frame, light: Array) -> np.ndarray:
    """What is measured of a frame's version, `(H, W, 3)` float64: the demodulated `light` times the
    albedo; of another program's picture, itself."""
    if frame.beauty is not None:
        return _float64(light)
    with np.errstate(invalid="ignore"):  # black times infinite
        return _float64(frame.albedo) * _float64(light)


def measure(frame: Frame, indirect: Array) -> dict[str, float | None]:
    """All metrics of demodulated `indirect` (H, W, 3) against the frame's own reference; of a frame
    with a `beauty`, of a picture against another.

    The reference has noise of its own, which `mse` contains and `mse_unbiased` does not; that one
    needs the half reference `reference_a`, and may come out negative where the error is small.
    Raises ValueError if the frame has no reference.
    """
    if frame.reference is None:
        raise ValueError("the frame has no layer reference to measure against")
    checks.image("indirect", indirect, 3)
    checks.same_size(indirect=indirect, reference=frame.reference)
    if frame.beauty is not None:
        return compare(indirect, frame.reference)
    x, y = reflected(frame, indirect), reflected(frame, frame.reference)
    half = None if frame.reference_a is None else reflected(frame, frame.reference_a)
    unbiased = None if half is None else unbiased_mse(x, half, 2 * y - half)
    return compare(x, y) | {"mse_unbiased": unbiased}


def compare(picture: Array, reference: Array) -> dict[str, float | None]:
    """All metrics of a linear picture (H, W, 3) that need nothing but its reference.

    All are NaN if a pixel of either is NaN or infinite.
    """
    x, y = _float64(picture), _float64(reference)
    checks.image("picture", x, 3)
    checks.same_size(picture=x, reference=y)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return dict.fromkeys(("psnr", "ssim", "flip", "rmse", "smape", "mse"), np.nan)
    scale = exposure(y)
    shown, wanted = display(x, scale), display(y, scale)
    return {
        "psnr": psnr(shown, wanted),
        "ssim": ssim(shown, wanted),
        "flip": flip(shown, wanted),
        "rmse": relative_mse(x, y),
        "smape": smape(x, y),
        "mse": float(np.mean((x - y) ** 2)),
    }


def psnr(picture: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two displayed pictures; infinite if they are equal."""
    # Takes most of a second, with what it needs.
    from skimage.metrics import peak_signal_noise_ratio

    with np.errstate(divide="ignore"):
        return float(peak_signal_noise_ratio(reference, picture, data_range=1))


def ssim(picture: np.ndarray, reference: np.ndarray) -> float | None:
    """Structural similarity of two displayed pictures; None below its window of 7 x 7 pixels."""
    if min(picture.shape[:2]) < 7:
        return None
    from skimage.metrics import structural_similarity

    return float(structural_similarity(reference, picture, data_range=1, channel_axis=-1))


def flip(picture: np.ndarray, reference: np.ndarray) -> float | None:
    """Mean LDR-FLIP of two displayed pictures; None without the package flip-evaluator."""
    errors = flip_map(picture, reference)
    return None if errors is None else float(np.mean(errors, dtype=np.float64))


def flip_map(picture: np.ndarray, reference: np.ndarray) -> np.ndarray | None:
    """LDR-FLIP of every pixel (H, W) of two displayed pictures, from 0 to 1; None as `flip`."""
    try:
        from flip_evaluator import evaluate
    except ImportError:
        return None
    pair = (reference.astype(np.float32), picture.astype(np.float32))
    errors, _, _ = evaluate(*pair, "LDR", inputsRGB=True, applyMagma=False, computeMeanError=False)
    return errors[..., 0]


def relative_mse(picture: np.ndarray, reference: np.ndarray) -> float:
    """Relative mean squared error: mean of (x - y)^2 / (y^2 + 0.01 mean(y)^2)."""
    epsilon = RELATIVE_EPSILON * np.mean(reference) ** 2
    return _mean_ratio((picture - reference) ** 2, reference**2 + epsilon)


def smape(picture: np.ndarray, reference: np.ndarray) -> float:
    """Symmetric mean absolute percentage error: mean of |x - y| / (|x| + |y|), 0 where both are 0.

    A share between 0 and 1.
    """
    return _mean_ratio(np.abs(picture - reference), np.abs(picture) + np.abs(reference))


def unbiased_mse(picture: np.ndarray, half_a: np.ndarray, half_b: np.ndarray) -> float:
    """Squared error without the reference's noise, from two independent halves of its samples.

    E[(x - a)(x - b)] = (x - y)^2 when a and b are independent with mean y.
    """
    return float(np.mean((picture - half_a) * (picture - half_b)))


def _mean_ratio(above: np.ndarray, below: np.ndarray) -> float:
    return float(np.mean(np.divide(above, below, out=np.zeros_like(above), where=below > 0)))


def _float64(array: Any) -> np.ndarray:
    return np.asarray(array, np.float64)
