"""BMFR's stages: what its noise on features and its TAA do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import plots, shots
from jflnr.bmfr.pipeline import BMFR
from jflnr.metrics import display, exposure

LENGTH = 16  # frames


def draw(folder: Path) -> None:
    """bmfr.jpg."""
    names = shots.names()
    name = next((name for name in names if name.endswith("camera")), names[-1])
    pictures = stages(shots.load(name).frames[:LENGTH])
    with plots.figure(folder / "bmfr.jpg", columns=3, rows=2, size=(4, 2.5)) as axes:
        for axis, (title, picture) in zip(axes, pictures.items(), strict=True):
            axis.imshow(picture, interpolation="nearest")
            axis.set(xticks=[], yticks=[], title=title)
            axis.grid(False)


def stages(frames: Sequence[jflnr.Frame]) -> dict[str, np.ndarray]:
    """Pictures of the indirect light, NaN in magenta."""
    first, last = frames[0], frames[-1]
    lights: dict[str, tuple[jflnr.Frame, Any]] = {"1 sample per pixel": (last, last.indirect)}
    lights["first frame, without noise on features"] = first, after([first], BMFR(noise=0.0))
    lights["first frame"] = first, after([first], BMFR())
    lights[f"after {len(frames)} frames, without TAA"] = (
        last,
        after(frames, BMFR(picture_share=1.0)),
    )
    lights[f"after {len(frames)} frames"] = last, after(frames, BMFR())
    lights["reference"] = last, last.reference
    return {name: shown(frame, np.asarray(light)) for name, (frame, light) in lights.items()}


def after(frames: Sequence[jflnr.Frame], method: BMFR) -> Any:
    """The image of the last frame."""
    denoiser = jflnr.Denoiser(method)
    return [denoiser.next(frame) for frame in frames][-1]


def shown(frame: jflnr.Frame, light: np.ndarray) -> np.ndarray:
    """As in the metrics, for the eye."""
    albedo, reference = np.asarray(frame.albedo), np.asarray(frame.reference)
    picture = display(albedo * light, exposure(albedo * reference))
    return np.where(np.isfinite(light), picture, np.array([1, 0, 1], np.float32))
