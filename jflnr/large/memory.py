"""How much memory a frame may take, and how large the pieces may then be."""

from __future__ import annotations

import re

import psutil

UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
# Of what is free, when nobody says how much.
SHARE = 0.5
# Measured (docs/large.md): what the program takes before any frame, and bytes per pixel of a frame
# that is denoised whole, of a piece that is worked on, and of a frame that is done in pieces.
BASE = 450 * 2**20
WHOLE, PIECE, REST = 400, 420, 1
# Smaller pieces would be nearly all overlap.
SMALLEST = 256


def parse(text: str) -> int:
    """`4G` in bytes; the units are K, M, G and T, of 1024. Raises ValueError."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    if not found or float(found[1]) == 0:
        raise ValueError(f"--memory must be a size such as 4G or 800M; got {text!r}")
    return int(float(found[1]) * UNITS[found[2].upper()])


def free() -> int:
    """The memory that a frame may take if nobody says: a share of what is free."""
    return int(SHARE * psutil.virtual_memory().available)


def tile_for(height: int, width: int, memory: int) -> int | None:
    """The side of the pieces for a frame of this size, or None if it may be denoised whole.

    Raises ValueError if even the smallest pieces would take more.
    """
    pixels = height * width
    if BASE + WHOLE * pixels <= memory:
        return None
    left = memory - BASE - REST * pixels
    side = int(max(left, 0) / PIECE) ** 0.5
    if side < SMALLEST:
        least = (BASE + REST * pixels + PIECE * SMALLEST**2) / 2**20
        raise ValueError(
            f"--memory: {width} x {height} pixels need at least {least:.0f}M; "
            f"{memory / 2**20:.0f}M are allowed"
        )
    return int(side) // 32 * 32
