"""Whether a scene is simple, from a sparse grid of its pixels, before any pass over all of them."""

from __future__ import annotations

import numpy as np

from jflnr.frame import Frame

# Pixels from one of the grid to the next.
STEP = 8
# Neighbours of the grid are on one surface if their normals and their depths differ by less, the
# depths as a share of the nearer one.
TURN, GAP = 0.3, 0.1


# A simple scene shows no more edges than this, and light that varies no more: its standard
# deviation in that of its mean, with the noise. Chosen on training frames (docs/select.md).
EDGES, SPREAD = 0.12, 4.0


def is_simple(frame: Frame) -> bool:
    """Whether large blocks will do: few edges, and no light so noisy that it hides the rest."""
    light = np.asarray(frame.indirect[STEP // 2 :: STEP, STEP // 2 :: STEP], np.float64).mean(-1)
    light = light[np.isfinite(light)]
    calm = light.size == 0 or light.std() <= SPREAD * light.mean()
    return bool(calm and edges(frame) <= EDGES)


def edges(frame: Frame) -> float:
    """Share of the neighbours on the grid between which one surface ends and another begins."""
    normal, depth = (
        np.asarray(layer[STEP // 2 :: STEP, STEP // 2 :: STEP], np.float32)
        for layer in (frame.normal, frame.depth)
    )
    with np.errstate(invalid="ignore", over="ignore"):  # pixels that are not finite are edges
        found = [_ends(normal, depth, axis) for axis in (0, 1)]
    count = sum(part.size for part in found)
    return float(sum(part.sum() for part in found)) / max(count, 1)


def _ends(normal: np.ndarray, depth: np.ndarray, axis: int) -> np.ndarray:
    """Where neighbours along an axis differ, one fewer along it."""
    first = [slice(None)] * 2
    last = [slice(None)] * 2
    first[axis], last[axis] = slice(None, -1), slice(1, None)
    here, there = depth[tuple(first)][..., 0], depth[tuple(last)][..., 0]
    turn = np.linalg.norm(normal[tuple(last)] - normal[tuple(first)], axis=-1)
    return ~(turn <= TURN) | ~(np.abs(there - here) <= GAP * np.minimum(here, there))
