"""How well errors over squares can be told at all, and how well method auto tells its own."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

import jflnr
from experiments import data, resume
from jflnr import exr
from jflnr.auto.method import denoise_on_blocks
from jflnr.auto.plan import COLLECTED

# Sides in pixels of the squares over which errors are averaged before they are ranked.
SIDES = (8, 16, 32, 64)
# Side in pixels of the smallest squares, and the form of method auto whose models are that large.
BLOCK, FORM = 8, "blocks-8"
# Noisy layers of 1 sample per pixel, each from its own random stream; every third scene is used.
DRAWS = ("indirect_1", "indirect_1_b", "indirect_1_c")
STEP = 3


def rank(true: np.ndarray, told: np.ndarray, used: np.ndarray, side: int) -> float:
    """Spearman's correlation over squares of `side` pixels that are wholly in use."""
    true, told, whole = (pool(image, side // BLOCK) for image in (true, told, used * 1.0))
    return float(spearmanr(true[whole > 0.99], told[whole > 0.99]).statistic)


def pool(image: np.ndarray, by: int) -> np.ndarray:
    h, w = (size // by for size in image.shape)
    return image[: h * by, : w * by].reshape(h, by, w, by).mean((1, 3))


def true_and_told(frame: jflnr.Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared error of the brightness, what the models expect of it, and which blocks count."""
    image, models = denoise_on_blocks(frame, FORM)
    weights = np.array([0.2126, 0.7152, 0.0722])
    off = ((np.asarray(image) - np.asarray(frame.reference)) @ weights) ** 2
    inside = np.ones_like(off) if frame.mask is None else np.asarray(frame.mask)[..., 0] > 0
    true, used = (pool(part * 1.0, BLOCK) for part in (off, inside))
    told = pool(np.asarray(models.error, np.float64), BLOCK // COLLECTED[FORM])
    return true, told[: true.shape[0], : true.shape[1]], used > 0.99


def one(path: Path) -> dict[str, Any]:
    """How well one draw of the noise tells the errors of another, from frames that have several.

    A block's own error is its expected error times a draw. If two draws correlate by r, the
    expected error itself, which no criterion can know better, correlates with one draw by sqrt(r)
    (Spearman's correction for attenuation).
    """
    frame, channels = jflnr.read_frame(path), exr.read_channels(path)
    true, told = [], []
    for layer in DRAWS:
        light = np.stack([channels[f"{layer}.{c}"] for c in "RGB"], axis=-1).astype(np.float32)
        found = true_and_told(dataclasses.replace(frame, indirect=light))
        true.append(found[0])
        told.append(found[1])
    used = found[2]
    row: dict[str, Any] = {"frame": data.label(path)}
    for side in SIDES:
        pairs = [rank(a, b, used, side) for a, b in itertools.combinations(true, 2)]
        ours = [rank(a, b, used, side) for a, b in zip(true, told, strict=True)]
        row[f"between draws {side}"] = float(np.mean(pairs))
        row[f"ceiling {side}"] = float(np.sqrt(max(float(np.mean(pairs)), 0.0)))
        row[f"ours {side}"] = float(np.mean(ours))
    return row


def with_draws() -> list[Path]:
    """Rendered training frames with several noisy layers of 1 sample, each of another scene."""
    found = sorted((resume.ROOT / "cache" / "frames" / "train").glob("*_100.exr"))[::STEP]
    wanted = {f"{layer}.R" for layer in DRAWS}
    return [path for path in found if wanted <= set(exr.read_channels(path))]
