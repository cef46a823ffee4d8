"""How much memory a frame may take, and how large the pieces may then be."""

import contextlib
import ctypes
import re
from typing import Any

import psutil

UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
# Of what is free, when nobody says how much.
SHARE = 0.5
# Measured (docs/large.md): what the program takes before any frame; bytes per pixel of a frame that
# is denoised whole, of a frame that waits in pieces, and of a piece with what it overlaps. For flnr
# counted, not measured: 28 bytes of its light, error and result; all that its network reads.
BASE = 450 * 2**20
WHOLE = {"flr": 320, "picture": 5300, "flnr-picture": 5300}
REST = {"flr": 1, "flr-adaptive": 1, "flnr": 32, "picture": 1, "flnr-picture": 48}
PIECE = {"flr": 230, "flr-adaptive": 160, "flnr": 400, "picture": 5300, "flnr-picture": 5300}
# Smaller pieces would be nearly all overlap.
SMALLEST = 256
# The name that glibc's <malloc.h> gives what `keep_freed` sets, and bytes that are kept.
TRIM_THRESHOLD, KEPT = -1, 2**29


def parse(text: str) -> int:
    """`4G` in bytes; the units are K, M, G and T, of 1024. Raises ValueError."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    if found and (size := int(float(found[1]) * UNITS[found[2].upper()])):
        return size
    raise ValueError(f"--memory must be a size such as 4G or 800M; got {text!r}")


def shown(size: float) -> str:
    """Bytes as `parse` reads them, in the largest unit that they fill."""
    unit = next(unit for unit in reversed(UNITS) if size >= UNITS[unit])
    return f"{size / UNITS[unit]:.4g}{unit}"


def free() -> int:
    """The memory that a frame may take if nobody says: a share of what is free."""
    return int(SHARE * psutil.virtual_memory().available)


def keep_freed() -> None:
    """Keep up to `KEPT` bytes that are freed for whatever is next, where the C library is glibc.

    It would hand the memory of a frame back to the system, and clearing new pages for the next one
    takes a fifth of the processor time of a folder.
    """
    with contextlib.suppress(OSError):
        ctypes.CDLL("libc.so.6").mallopt(TRIM_THRESHOLD, KEPT)


def holds(height: int, width: int, memory: int, at_once: int) -> bool:
    """Whether whole frames may be read, though they may have to be denoised in tiles."""
    return BASE + at_once * WHOLE["flr"] * height * width <= memory


def tile_for(height: int, width: int, memory: int, at_once: int, method: Any) -> int | None:
    """The side of the pieces for a frame of this size, or None if it may be denoised whole.

    memory: bytes that may be taken. at_once: how many whole frames are in memory together.
    Raises ValueError if even the smallest pieces would take more.
    """
    pixels = height * width
    if BASE + at_once * WHOLE.get(method.name, WHOLE["flr"]) * pixels <= memory:
        return None
    if not hasattr(method, "stages"):
        raise ValueError(f"method {method.name} needs the whole frame in memory: raise --memory")
    kind = method.name if method.name in PIECE else "flnr"
    overlap = 2 * min(max(stage.reach for stage in method.stages()), max(height, width))
    fixed = BASE + REST[kind] * pixels
    side = max((memory - fixed) / PIECE[kind], 0) ** 0.5 - overlap
    if side < SMALLEST:
        least = fixed + PIECE[kind] * (SMALLEST + overlap) ** 2
        raise ValueError(
            f"--memory: {shown(memory)} is too little for {width} x {height} pixels with "
            f"{method.name}; about {shown(least)} is needed"
        )
    return int(side) // 32 * 32
