"""Pictures beside a denoised frame: a preview to look at, and what `--explain` draws."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from jflnr.files import replacing
from jflnr.frame import Frame
from jflnr.metrics import display

# Of places that are refined, and of the others; also told apart without colour, by brightness.
REFINED, COARSE = (250, 230, 90), (40, 60, 110)


def write_preview(path: Path, picture: np.ndarray, scale: float) -> None:
    """Write linear radiance (H, W, 3), times `scale`, in 8 bits by the metrics' display rule."""
    _save(path, 255 * display(np.nan_to_num(picture), scale))


def explain(path: Path, frame: Frame, method: Any, guides: Sequence[str] | None) -> list[str]:
    """Where method auto refines a frame, in lines for a person and as a map."""
    refined, said = plan_of(frame, method, guides)
    _save(path, np.where(refined[..., None], REFINED, COARSE))
    return [said, f"map: {path}"]


def plan_of(frame: Frame, method: Any, guides: Sequence[str] | None) -> tuple[np.ndarray, str]:
    """Where method auto refines a frame, `(H, W)`, and how much of it that is in words."""
    from jflnr.regression.auto import signal_in_tiles

    signal, side = signal_in_tiles(frame, method, guides)
    height, width = frame.depth.shape[:2]
    refined = (signal > method.worth).repeat(side, 0).repeat(side, 1)[:height, :width]
    return refined, f"refined: {refined.mean():.0%} of the frame, in tiles of {side} pixels"


def _save(path: Path, pixels: np.ndarray) -> None:
    """Write `(H, W, 3)` of 0 to 255, as the path's ending says, whole or not at all."""
    with replacing(path) as beside:
        Image.fromarray(np.round(pixels).astype(np.uint8)).save(beside, quality=95)
