"""PNG files beside a denoised frame: a preview to look at, and what `--explain` draws."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from jflnr.files import replacing
from jflnr.metrics import display

if TYPE_CHECKING:
    from jflnr.auto.plan import Plan
    from jflnr.frame import Frame

# From a constant to the model with all guides; also told apart without colour, by brightness.
COLOURS = np.array([[20, 20, 60], [40, 100, 150], [70, 170, 130], [250, 230, 90]])


def write_preview(path: Path, picture: np.ndarray, scale: float) -> None:
    """Write linear radiance (H, W, 3), times `scale`, as 8-bit PNG by the metrics' display rule."""
    _save(path, 255 * display(np.nan_to_num(picture), scale))


def explain(path: Path, frame: "Frame", guides: Sequence[str] | None) -> list[str]:
    """The plan of method auto in lines for a person, and the orders of its models as a map."""
    from jflnr.auto.method import plan_of

    plan = plan_of(frame, guides)
    write_map(path, plan, frame.depth.shape[:2])
    return [*plan.lines(), f"map of the orders: {path}"]


def write_map(path: Path, plan: "Plan", size: Sequence[int]) -> None:
    """The orders of the plan's blocks as colours, at `size` (H, W)."""
    place = np.clip(plan.order / max(plan.groups, 1), 0, 1) * (len(COLOURS) - 1)
    channels = [np.interp(place, range(len(COLOURS)), colour) for colour in COLOURS.T]
    enlarged = np.stack(channels, -1).repeat(plan.side, 0).repeat(plan.side, 1)
    _save(path, enlarged[: size[0], : size[1]])


def _save(path: Path, pixels: np.ndarray) -> None:
    """Write `(H, W, 3)` of 0 to 255, whole or not at all."""
    with replacing(path) as beside:
        Image.fromarray(np.round(pixels).astype(np.uint8)).save(beside, format="PNG")
