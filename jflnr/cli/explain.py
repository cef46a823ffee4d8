"""`--explain`: the plan of method auto in a few lines, and a map of the orders of its models."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from jflnr.files import replacing

if TYPE_CHECKING:
    from jflnr.auto.plan import Plan
    from jflnr.frame import Frame

# From a constant to the model with all guides; also told apart without colour, by brightness.
COLOURS = np.array([[20, 20, 60], [40, 100, 150], [70, 170, 130], [250, 230, 90]])


def explain(path: Path, frame: "Frame", guides: Sequence[str] | None) -> list[str]:
    """Lines for a person; writes the map to `path`, a PNG."""
    from jflnr.auto.method import plan_of

    plan = plan_of(frame, guides)
    write_map(path, plan, frame.depth.shape[:2])
    return [*plan.lines(), f"map of the orders: {path}"]


def write_map(path: Path, plan: "Plan", size: Sequence[int]) -> None:
    """The orders of the plan's blocks as colours, at `size` (H, W)."""
    place = np.clip(plan.order / max(plan.groups, 1), 0, 1) * (len(COLOURS) - 1)
    channels = [np.interp(place, range(len(COLOURS)), colour) for colour in COLOURS.T]
    picture = Image.fromarray(np.round(np.stack(channels, -1)).astype(np.uint8))
    whole = (picture.width * plan.side, picture.height * plan.side)
    enlarged = picture.resize(whole, Image.Resampling.NEAREST)
    with replacing(path) as beside:
        enlarged.crop((0, 0, size[1], size[0])).save(beside, format="PNG")
