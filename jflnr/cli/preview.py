"""A tone-mapped PNG of a linear picture, to look at."""

from pathlib import Path

import numpy as np
from PIL import Image

from jflnr.files import replacing
from jflnr.metrics import display


def write_preview(path: Path, picture: np.ndarray, scale: float) -> None:
    """Write linear radiance (H, W, 3), times `scale`, as 8-bit PNG by the metrics' display rule."""
    pixels = np.round(255 * display(np.nan_to_num(picture), scale)).astype(np.uint8)
    with replacing(path) as beside:
        Image.fromarray(pixels).save(beside, format="PNG")
