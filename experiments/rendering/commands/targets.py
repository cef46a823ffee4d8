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
from jflnr.frame import HALF_MAX, read_frame
from jflnr.metrics import exposure


def run(arguments: argparse.Namespace) -> None:
    """Denoise the reference of every frame in `--folder`/train into a layer `target`."""
    paths = sorted((arguments.folder / "train").glob("*.exr"))
    made = sum(add_target(path) for path in paths)
    print(f"{len(paths)} frames have a layer target, {made} of them new")


def add_target(path: Path) -> bool:
    """Add the layer to a frame; whether it was not there."""
    channels = exr.read_channels(path)
    if "target.R" in channels:
        return False
    frame = read_frame(path)
    assert frame.reference is not None
    # OIDN sees pictures as they are shown.
    scale = exposure(np.asarray(frame.albedo) * frame.reference)
    light = dataclasses.replace(frame, indirect=np.asarray(frame.reference, np.float32) * scale)
    target = np.maximum(oidn.denoise(light, clean=True), 0) / scale
    if frame.mask is not None:
        target = target * (frame.mask > 0)
    target = np.minimum(target, HALF_MAX).astype(np.float16)
    layer = {f"target.{c}": target[..., i] for i, c in enumerate("RGB")}
    exr.write_channels(path, channels | layer, exr.read_attributes(path).comments)
    return True
