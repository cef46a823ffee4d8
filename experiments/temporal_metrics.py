"""How a denoised sequence behaves in time: flicker, lag after a change of light, parts of it.

Flicker is taken, as all picture metrics are (`jflnr.metrics`), on displayed pictures; one exposure
serves the whole sequence, or its changes would count. Time is in frames.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from jflnr.frame import Array, Frame
from jflnr.metrics import display, exposure, psnr, reflected, ssim, unbiased_mse
from jflnr.temporal.flicker import luminance, taps_between, warped_change, warped_error

# Lag compares means over squares of so many pixels: what noise is left there is small.
SQUARE = 8
# Steps of the lag that is searched for.
STEPS = 10
# Frames since a place was first seen, and how they are grouped.
AGES = {"0": (0, 1), "1 to 3": (1, 4), "4 to 7": (4, 8), "8 and more": (8, np.inf)}

# What moves less, in pixels, stands still.
STILL = 0.3


def measure_sequence(frames: Sequence[Frame], lights: Sequence[Array]) -> list[dict]:
    """`psnr`, `psnr_unbiased`, `ssim`, and the errors `temporal`, `warped` and `false` (that of
    `false_change`) of every frame.

    psnr_unbiased leaves out the noise of the references (`jflnr.metrics.unbiased_mse`, on displayed
    pictures); None without half references, and where nothing else is left.
    lights: demodulated indirect light `(H, W, 3)` of each frame. The first frame has no errors in
    time. Raises ValueError for a frame without a reference or, from the second on, motion.
    """
    if len(frames) != len(lights) or not frames:
        raise ValueError(f"{len(frames)} frames and {len(lights)} denoised ones do not match")
    if any(frame.reference is None for frame in frames):
        raise ValueError("every frame needs a layer reference to measure against")
    scale = sequence_exposure(frames)
    rows = [_measure(frame, light, scale) for frame, light in zip(frames, lights, strict=True)]
    for i in range(1, len(frames)):
        pair = (frames[i - 1], frames[i]), (lights[i - 1], lights[i])
        rows[i]["temporal"] = temporal_error(*pair, scale)
        rows[i]["warped"] = warped_error(*pair, scale)
        rows[i]["false"] = false_change(*pair, scale)
    return rows


def _measure(frame: Frame, light: Array, scale: float) -> dict[str, float | None]:
    shown, true = (_displayed(frame, image, scale) for image in (light, frame.reference))
    error = None
    if frame.reference_a is not None:
        error = unbiased_mse(shown, *(_displayed(frame, half, scale) for half in _halves(frame)))
    return {
        "psnr": psnr(shown, true),
        "psnr_unbiased": None if error is None or error <= 0 else float(-10 * np.log10(error)),
        "ssim": ssim(shown, true),
    }


def sequence_exposure(frames: Sequence[Frame]) -> float:
    """The factor that brings the mean of all references to 0.35."""
    return exposure(np.stack([reflected(frame, np.asarray(frame.reference)) for frame in frames]))


def temporal_error(frames: tuple[Frame, Frame], lights: tuple[Array, Array], scale: float) -> float:
    """Mean absolute difference of the luminance of adjacent pictures (BMFR, Table 3).

    It contains what truly changes: compare it with that of the references.
    """
    before, now = (
        luminance(frame, light, scale) for frame, light in zip(frames, lights, strict=True)
    )
    return float(np.mean(np.abs(now - before)))


def false_change(
    frames: tuple[Frame, Frame], lights: tuple[Array, Array], scale: float
) -> float | None:
    """Mean square of what differs between the change that `warped_error` sees and the true one.

    So what flickers counts, and what should change and does not. The half references leave out
    their noise, hence it may be below 0; None without them.
    """
    if any(frame.reference_a is None for frame in frames):
        return None
    pairs = lights, *zip(*(_halves(frame) for frame in frames), strict=True)
    change, true_a, true_b = (warped_change(frames, pair, scale) for pair in pairs)
    return float(np.mean((change - true_a) * (change - true_b))) if change.size else None


def lag(lights: Array, references: Array) -> float:
    """How many frames ago the light was as the denoised sequence shows it.

    The delay, of at most half the sequence, at which its second half is nearest to the references,
    which are interpolated between frames. lights, references: `(T, H, W, 3)`, demodulated.
    """
    shown, true = (_squares(np.asarray(images, np.float64)) for images in (lights, references))
    first = len(true) // 2
    delays = np.arange(first * STEPS + 1) / STEPS

    def distance(delay: float) -> float:
        whole, part = int(delay), delay % 1
        late = true[first - whole : len(true) - whole]
        later = true[first - whole - 1 : len(true) - whole - 1] if part else late
        return float(np.sum((shown[first:] - (1 - part) * late - part * later) ** 2))

    return float(delays[np.argmin([distance(delay) for delay in delays])])


def response(lights: Array, before: Array, after: Array) -> np.ndarray:
    """How far each frame has followed a change of light: 0 as before it, 1 as after it, `(T,)`.

    lights: `(T, H, W, 3)`. before, after: the converged light `(H, W, 3)`.
    """
    shown, old, new = (_squares(np.asarray(i, np.float64)) for i in (lights, before, after))
    change = new - old
    if not (power := np.sum(change**2)):
        raise ValueError("the light before and after is the same, so nothing can be followed")
    return np.sum((shown - old) * change, axis=(1, 2, 3)) / power


def ages(frames: Sequence[Frame]) -> np.ndarray:
    """For how many frames each pixel's place has been in view, `(T, H, W)`.

    Infinite for what has been since the first frame.
    """
    found = [np.full(frames[0].normal.shape[:2], np.inf)]
    for before, now in itertools.pairwise(frames):
        taps = taps_between(before, now)
        nearest = np.argmax(taps.weight, axis=-1, keepdims=True)
        place = np.take_along_axis(np.asarray(taps.pixel), nearest, axis=-1)[..., 0]
        found.append(np.where(np.asarray(taps.seen)[..., 0], found[-1].ravel()[place] + 1, 0))
    return np.stack(found)


def by_region(
    frames: Sequence[Frame], lights: Sequence[Array], still_camera: bool
) -> dict[str, float | None]:
    """PSNR of displayed pixels in parts of the picture, less the noise of the references where
    there are halves of them; None for a part without pixels, or without any error.

    `moving`: what moves across the picture, if the camera stands still. All else by how long ago it
    came into view (`AGES`), or `always` in view. Pixels outside the mask are left out.
    """
    error, age = _squared_errors(frames, lights), ages(frames)
    speed = np.stack([np.abs(np.asarray(frame.motion)).max(axis=-1) for frame in frames])
    moves = (speed > STILL) & still_camera
    parts = {"moving": moves}
    parts |= {name: (age >= low) & (age < high) & ~moves for name, (low, high) in AGES.items()}
    parts["always"] = np.isinf(age) & ~moves
    return {name: _psnr(error[part]) for name, part in parts.items()}


def _squared_errors(frames: Sequence[Frame], lights: Sequence[Array]) -> np.ndarray:
    """Of displayed pixels, `(T, H, W)`; NaN outside the mask. With half references their product,
    whose mean leaves out the references' noise."""
    scale, errors = sequence_exposure(frames), []
    for frame, light in zip(frames, lights, strict=True):
        true = [_displayed(frame, half, scale) for half in _halves(frame)]
        shown = _displayed(frame, light, scale)
        error = np.mean((shown - true[0]) * (shown - true[-1]), axis=-1)
        inside = True if frame.mask is None else np.asarray(frame.mask)[..., 0] > 0
        errors.append(np.where(inside, error, np.nan))
    return np.stack(errors)


def _halves(frame: Frame) -> list[np.ndarray]:
    """Both halves of the reference, or the reference itself."""
    if frame.reference_a is None:
        return [np.asarray(frame.reference, np.float64)]
    half = np.asarray(frame.reference_a, np.float64)
    return [half, 2 * np.asarray(frame.reference, np.float64) - half]


def _psnr(errors: np.ndarray) -> float | None:
    """Of squared errors that are known; None without any."""
    mean = np.mean(errors, where=np.isfinite(errors)) if np.isfinite(errors).any() else 0
    return float(-10 * np.log10(mean)) if mean > 0 else None


def _displayed(frame: Frame, light: Array | None, scale: float) -> np.ndarray:
    return display(reflected(frame, np.asarray(light)), scale)


def _squares(images: np.ndarray) -> np.ndarray:
    """Means over squares of pixels, `(..., h, w, 3)`; what is left over at the borders is not used.

    images: `(..., H, W, 3)`.
    """
    *rest, height, width, channels = images.shape
    side = min(SQUARE, height, width)
    h, w = height // side, width // side
    cut = images[..., : h * side, : w * side, :]
    return cut.reshape(*rest, h, side, w, side, channels).mean((-4, -2))
