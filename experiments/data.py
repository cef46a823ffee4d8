"""Where the frames are, split by scene."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from jflnr.denoising import SHIPPED_FRAME as SHIPPED


def folder() -> Path:
    """JFLNR_DATA, else `shared/data` beside the repository."""
    default = Path(__file__).parents[2] / "shared" / "data"
    return Path(os.environ.get("JFLNR_DATA", default))


def frames(*splits: str) -> list[Path]:
    """The frames of the splits (train, val, test); the one that ships if there are none here."""
    found = [path for split in splits for path in sorted((folder() / split).glob("*.exr"))]
    if not found:
        print(f"No frames in {folder()} (set JFLNR_DATA): using the one that ships with jflnr.")
        return [SHIPPED]
    return found


def one_view_each(split: str) -> list[Path]:
    """The first frame of each scene of a split."""
    return list({path.stem.rsplit("_", 1)[0]: path for path in frames(split)[::-1]}.values())[::-1]


def label(path: Path) -> str:
    """split/scene_view, as in the published baselines."""
    return f"{path.parent.name}/{path.stem}"


def read(path: Path, *streams: int) -> jflnr.Frame:
    """The frame with the mean of its noisy layers of `streams` (1 by default), and its position.

    The streams are independent, so that (1, 4) is 5 samples per pixel.
    """
    streams = streams or (1,)
    frames = [jflnr.read_frame(path, spp) for spp in streams]
    total = sum(spp * np.asarray(f.indirect) for spp, f in zip(streams, frames, strict=True))
    frame = dataclasses.replace(frames[0], indirect=np.asarray(total / sum(streams), np.float32))
    if frame.position is None:
        frame = dataclasses.replace(frame, position=position(frame, jflnr.read_header(path)))
    return frame


def but(frame: jflnr.Frame, **layers: Any) -> jflnr.Frame:
    """The frame with other layers."""
    return dataclasses.replace(frame, **layers)


def has(path: Path, spp: int) -> bool:
    """Whether the frame was rendered with that many samples."""
    try:
        jflnr.read_frame(path, spp=spp)
    except ValueError:
        return False
    return True


def position(frame: jflnr.Frame, header: dict[str, Any]) -> np.ndarray:
    """World position `(H, W, 3)` from depth and the header's camera (DESIGN.md, "The frame")."""
    depth = np.asarray(frame.depth)[..., 0]
    height, width = depth.shape
    slope = np.tan(np.radians(header["fov_x_degrees"]) / 2)
    rows, columns = np.mgrid[:height, :width] + 0.5
    # x to the left and y up, both in units of the depth.
    x = (1 - 2 * columns / width) * slope
    y = (height - 2 * rows) / width * slope
    local = np.stack([x * depth, y * depth, depth, np.ones_like(depth)], axis=-1)
    world = local @ np.asarray(header["camera_to_world"]).T
    return np.where(depth[..., None] > 0, world[..., :3], 0).astype(np.float32)
