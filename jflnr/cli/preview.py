"""A tone-mapped PNG of a linear picture, to look at."""

from pathlib import Path

import numpy as np
from PIL import Image

from jflnr.files import replacing
from jflnr.metrics import display, exposure


def write_preview(path: Path, picture: np.ndarray) -> None:
    """Write linear radiance (H, W, 3) as 8-bit PNG: the metrics' display rule, on its own mean."""
    clean = np.nan_to_num(picture, nan=0, posinf=0, neginf=0)
    pixels = np.round(255 * display(clean, exposure(clean))).astype(np.uint8)
    try:
        with replacing(path) as beside:
            Image.fromarray(pixels).save(beside, format="PNG")
    except OSError as error:
        raise OSError(f"{path} cannot be written: {error.strerror or error}") from None
