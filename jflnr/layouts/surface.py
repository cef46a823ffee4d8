"""How many pixels of a frame are denoised, and why none is."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jflnr.layouts.light import DARK

# Farther than anything: programs write 1e10 or infinity where nothing is hit.
SKY = 1e9


def denoised(images: Mapping[str, Any], whole: bool) -> tuple[int, str]:
    """The number of pixels that are denoised, and a sentence that says why if there are none.

    images: the layers of a frame, (H, W, C) or None. whole: whether it is denoised as a picture,
    whose mask does not count and whose guides without a number are those of their neighbours.
    """
    finite = lambda name: whole | np.isfinite(images[name]).all(axis=-1)
    depth, mask = np.asarray(images["depth"])[..., 0], None if whole else images["mask"]
    seen = (depth > 0) & (depth < SKY) if mask is None else np.asarray(mask)[..., 0] > 0
    guides = seen & finite("normal") & finite("depth")
    if not seen.any() and not ((depth > 0) & (depth < SKY)).any():
        why = f"its depth is nowhere between 0 and {SKY:g}"
    elif not seen.any():
        why = f"its mask is 0, or its albedo {DARK} or less, wherever it has a depth"
    elif not guides.any():
        why = "normal or depth is NaN or infinite wherever there is a surface"
    else:
        why = ""
    return int(guides.sum()), why and f"nothing is denoised, as no pixel has a surface: {why}"
