"""A shot as the page plays it: each frame of each version as it is displayed, in PNG of 8 bits."""

import base64
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from jflnr import exr
from jflnr.files import json_object
from jflnr.frame import Frame
from jflnr.metrics import display, exposure
from jflnr.report.scenes import Scene, collect, is_picture

# Pixels; wider frames are made smaller by whole numbers.
WIDEST = 1280
# Bytes of all pictures together, which browsers still open.
LIMIT = 200_000_000
# Attributes that tell frames per second, and what is meant without one.
RATES, RATE = ("framesPerSecond", "fps"), 24.0


@dataclass(frozen=True)
class Shot:
    """Frames in their order. files: of each, its own and those of what it was denoised to.

    spp, layers: as of `read_frame`.
    """

    files: Sequence[Sequence[Path]]
    spp: int = 1
    layers: Mapping[str, str] | None = None

    @property
    def name(self) -> str:
        """That of the folder with the frames."""
        return self.files[0][0].resolve().parent.name

    @property
    def rate(self) -> float:
        """Frames per second, of the first frame's header."""
        told = exr.read_attributes(self.files[0][0]).others
        for name in RATES:
            try:
                if 0 < (rate := float(told[name])) < np.inf:
                    return rate
            except (KeyError, TypeError, ValueError):
                continue
        return RATE

    def scenes(self) -> Iterator[Scene]:
        """One frame after another, read anew. Raises OSError and ValueError as `collect` does, and
        for frames whose versions or sizes are not those of the first."""
        header, first = dict[str, Any](), None
        for paths in self.files:
            (scene,) = collect(paths, self.spp, None, self.layers)
            first = scene if first is None else first
            if (list(scene.images), scene.size) != (list(first.images), first.size):
                raise ValueError(
                    f"{paths[0]}: its size or its versions ({', '.join(scene.images)}) are not "
                    "those of the first frame, so that they make no shot"
                )
            before, header = header, json_object(exr.read_attributes(paths[0]).comments)
            if scene.frame is not None:
                from jflnr.temporal.camera import with_motion

                scene = replace(scene, frame=with_motion(scene.frame, header, before))
            yield replace(scene, name=paths[0].name)


def collect_shot(paths: Sequence[Path], spp: int, layers: Mapping[str, str] | None = None) -> Shot:
    """The frames of one folder, in the order given, and what was denoised from them in others, by
    the names of the files. Raises OSError for a file that cannot be read, and ValueError, in one
    sentence, for what makes no shot."""
    folders = list(dict.fromkeys(path.parent for path in paths))
    names = list(dict.fromkeys(path.name for path in paths))
    if missing := [f / name for name in names for f in folders if f / name not in paths]:
        raise ValueError(
            f"{missing[0]} is missing: every version of a shot needs all of its frames, in a "
            "folder of their own, under the same names"
        )
    of_frames = [f for f in folders if not is_picture(exr.read_attributes(f / names[0]).names)]
    if len(of_frames) > 1:
        raise ValueError(
            f"{of_frames[0]} and {of_frames[1]} both hold frames: a page plays one shot"
        )
    folders.sort(key=lambda folder: folder not in of_frames)
    return Shot([[folder / name for folder in folders] for name in names], spp, layers)


def shot_data(shot: Shot) -> dict[str, Any]:
    """What the page needs to know of a shot, as JSON values. Raises as `Shot.scenes` does, and
    ValueError for one that is too large."""
    scale = exposure(np.array([np.mean(s.known(s.judge)) for s in shot.scenes()]))
    names, pictures, errors, bytes_there, before = [], [], [], 0, None
    for scene in shot.scenes():
        names.append(scene.name)
        pictures.append([_png(display(scene.radiance(i), scale)) for i in scene.images.values()])
        errors.append([_warped(before, scene, version, scale) for version in scene.images])
        bytes_there += sum(map(len, pictures[-1]))
        if bytes_there > LIMIT:
            raise ValueError(
                f"the page would be larger than {LIMIT / 1e6:.0f} MB, of which the first "
                f"{len(names)} of {len(shot.files)} frames take all: give fewer frames or versions"
            )
        before = scene
    assert before is not None
    versions = zip(
        before.images, zip(*pictures, strict=True), zip(*errors, strict=True), strict=True
    )
    images = [
        {"name": name, "frames": frames, "warped": warped, "maps": {}, "metrics": _mean(warped)}
        for name, frames, warped in versions
    ]
    height, width = (-(-side // _shrink(before.size[1])) for side in before.size)
    return {
        "name": shot.name,
        "height": height,
        "width": width,
        "unit": 1,
        "exposures": {"reflected": scale},
        "layers": {},
        "images": images,
        "crops": [],
        "rate": shot.rate,
        "frames": names,
    }


def _warped(before: Scene | None, now: Scene, version: str, scale: float) -> float | None:
    """The warped error of a version; None for the first frame, and where motion is not known."""
    if before is None or before.frame is None or now.frame is None or now.frame.motion is None:
        return None
    from jflnr.temporal.flicker import warped_error

    frames: tuple[Frame, Frame] = before.frame, now.frame
    return warped_error(frames, (before.images[version], now.images[version]), scale)


def _mean(errors: Sequence[float | None]) -> dict[str, float] | None:
    known = [error for error in errors if error is not None]
    return {"warped": float(np.mean(known))} if known else None


def _shrink(width: int) -> int:
    return -(-width // WIDEST)


def _png(shown: np.ndarray) -> str:
    """A displayed picture `(H, W, 3)` of 0 to 1 in PNG, as base64; NaN is black."""
    image = Image.fromarray(np.round(255 * np.nan_to_num(shown)).astype(np.uint8))
    file = io.BytesIO()
    image.reduce(_shrink(image.width)).save(file, format="PNG")
    return base64.b64encode(file.getvalue()).decode()
