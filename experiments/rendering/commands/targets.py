"""`render targets`: adds to the training frames what the network is trained on; resumes.

A hundred guided samples are noisier than what adaptive FLR makes of sixteen, and teach little; and
a denoiser that they are put through must not hand on what it takes for noise.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import scipy.ndimage

from experiments.peers import oidn
from jflnr import exr
from jflnr.frame import HALF_MAX, Frame, read_frame
from jflnr.metrics import display, exposure

# Share of the noise that an error must exceed, or chance would let noise in.
DOUBT = 0.25


def run(arguments: argparse.Namespace) -> None:
    """Denoise the reference of every frame in `--folder` into a layer `target`."""
    folders = [arguments.folder / split for split in ("train", "val")]
    paths = sorted(path for folder in folders for path in folder.glob("*.exr"))
    made = sum(add_target(path) for path in paths)
    print(f"{len(paths)} frames have a layer target, {made} of them new")


def add_target(path: Path) -> bool:
    """Add the layer to a frame; whether it was not there."""
    channels = exr.read_channels(path)
    if "target.R" in channels:
        return False
    target = of_picture(channels) if "beauty_1.R" in channels else of_light(read_frame(path))
    target = np.clip(target, 0, HALF_MAX).astype(np.float16)
    layer = {f"target.{c}": target[..., i] for i, c in enumerate("RGB")}
    exr.write_channels(path, channels | layer, exr.read_attributes(path).comments)
    return True


def of_light(frame: Frame) -> np.ndarray:
    """The reference of a frame of indirect light, denoised, `(H, W, 3)`."""
    assert frame.reference is not None
    # OIDN sees pictures as they are shown.
    scale = exposure(np.asarray(frame.albedo) * frame.reference)
    light = dataclasses.replace(frame, indirect=np.asarray(frame.reference, np.float32) * scale)
    target = oidn.denoise(light, clean=True) / scale
    return target if frame.mask is None else target * (frame.mask > 0)


def of_picture(channels: dict[str, np.ndarray]) -> np.ndarray:
    """The reference of a whole picture, denoised with its layers, `(H, W, 3)`."""
    wanted = {"reference": "RGB", "seen_albedo": "RGB", "seen_normal": "XYZ", "reference_a": "RGB"}
    picture, albedo, normal, first = (
        np.stack([channels[f"{name}.{c}"] for c in parts], axis=-1).astype(np.float32)
        for name, parts in wanted.items()
    )
    denoised = oidn.prefiltered(picture, albedo=np.clip(albedo, 0, 1), normal=normal)
    return with_detail(denoised, first, 2 * picture - first)


def with_detail(denoised: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The denoised picture, with as much of the noisy one as makes the least error, `(H, W, 3)`.

    first, second: independent halves of the noisy one. What is left of both denoised in common,
    over a window, is error; what they differ by is noise.
    """
    noisy = (first + second) / 2
    scale = exposure(noisy)
    a, b, shown = (display(image, scale) for image in (first, second, denoised))

    def mean(image: np.ndarray) -> np.ndarray:
        return scipy.ndimage.uniform_filter(image.mean(axis=-1, keepdims=True), (9, 9, 1))

    noise = mean((a - b) ** 2) / 4
    error = np.maximum(mean((shown - a) * (shown - b)) - DOUBT * noise, 0)
    return denoised + error / np.maximum(error + noise, 1e-9) * (noisy - denoised)
