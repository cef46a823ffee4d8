"""Where to look first: the squares in which the versions of a scene differ most."""

import numpy as np
from scipy.ndimage import uniform_filter

from jflnr.metrics import display, exposure
from jflnr.report.scenes import NOISY, REFERENCE, Scene

SIZE = 64
COUNT = 2


def find_crops(scene: Scene, size: int = SIZE) -> list[dict[str, int]]:
    """Squares `{"x", "y", "size"}` inside the picture, far apart, the most different first."""
    height, width = scene.size
    size = min(size, height, width)
    spread = uniform_filter(_spread(scene), size, mode="nearest")
    half = size // 2
    # Only centres whose square lies inside.
    inside = spread[half : height - size + half + 1, half : width - size + half + 1]
    found = []
    for _ in range(COUNT):
        y, x = (int(i) for i in np.unravel_index(np.argmax(inside), inside.shape))
        if inside[y, x] < 0:
            break
        found.append({"x": x, "y": y, "size": size})
        inside[max(y - size + 1, 0) : y + size, max(x - size + 1, 0) : x + size] = -1
    return found


def _spread(scene: Scene) -> np.ndarray:
    """How far the errors of the versions lie apart at every pixel, as displayed, (H, W)."""
    basis = scene.known(scene.judge)
    scale = exposure(basis)
    shown = lambda name: display(scene.known(scene.images[name]), scale)
    judged = [n for n in scene.images if n not in (NOISY, REFERENCE)] or scene.images
    errors = [np.mean((shown(name) - display(basis, scale)) ** 2, axis=-1) for name in judged]
    return np.ptp(errors, axis=0) if len(errors) > 1 else errors[0]
