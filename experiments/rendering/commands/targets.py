"""`render targets`: adds to the training frames what the network is trained on; resumes.

A hundred guided samples are noisier than what adaptive FLR makes of sixteen, and teach little.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from experiments.peers import oidn
from jflnr import exr
from jflnr.frame import HALF_MAX, Frame, read_frame
from jflnr.metrics import exposure


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
    """The reference of a whole picture, denoised with the layers of as many samples."""
    wanted = {"reference": "RGB", "seen_albedo": "RGB", "seen_normal": "XYZ"}
    picture, albedo, normal = (
        np.stack([channels[f"{name}.{c}"] for c in parts], axis=-1).astype(np.float32)
        for name, parts in wanted.items()
    )
    return oidn.prefiltered(picture, albedo=np.clip(albedo, 0, 1), normal=normal)
