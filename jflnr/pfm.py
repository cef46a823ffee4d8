"""PFM files, the plain pictures that Open Image Denoise's command reads and writes.

http://www.pauldebevec.com/Research/HDR/PFM/: three lines of text, then rows of floats from the
lowest to the highest.
"""

import math
import os
import re
from pathlib import Path

import numpy as np

from jflnr.files import write_atomically

KINDS = {b"PF": "RGB", b"Pf": "Y"}
# Kind, width and height; by what the numbers are to be multiplied, below 0 if they are
# little-endian, as Open Image Denoise has it. It ends where the numbers begin: the first of them
# may look like white space.
HEADER = re.compile(
    rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
)
END = re.compile(rb"\s|\r\n")
LONGEST = 256  # bytes of a header
LEAST, MOST = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)


def named(path: Path) -> bool:
    """Whether a file of this name is one."""
    return path.suffix.lower() == ".pfm"


def read(path: Path) -> dict[str, np.ndarray]:
    """The channels R, G and B, or Y, `(H, W)` float32.

    Raises OSError for a file that cannot be opened, ValueError for one that is none.
    """
    with path.open("rb") as file:
        start, size = file.read(LONGEST), os.fstat(file.fileno()).st_size
    if (header := HEADER.match(start)) is None:
        raise ValueError(f"{path} is not a PFM file")
    names, scale = KINDS[header[1]], float(header[4])
    shape = int(header[3]), int(header[2]), len(names)
    first = size - 4 * math.prod(shape)
    end = END.fullmatch(start[header.end() : max(first, 0)])
    if not (math.prod(shape) and end and LEAST <= abs(scale) <= MOST):
        raise ValueError(f"{path} is a truncated or damaged PFM file")
    stored = np.fromfile(path, "<f4" if scale < 0 else ">f4", offset=first)
    with np.errstate(all="ignore"):
        image = (stored.reshape(shape)[::-1] * abs(scale)).astype(np.float32)
    return {name: image[..., i] for i, name in enumerate(names)}


def write(path: Path, image: np.ndarray) -> None:
    """Write `(H, W, 3)`, whole or not at all."""
    height, width = image.shape[:2]
    header = f"PF\n{width} {height}\n-1.0\n".encode()
    write_atomically(path, header + image[::-1].astype("<f4").tobytes())
