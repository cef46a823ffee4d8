"""PFM files, the plain pictures that Open Image Denoise's command reads and writes.

http://www.pauldebevec.com/Research/HDR/PFM/: three lines of text, then rows of floats from the
lowest to the highest.
"""

import re
from pathlib import Path

import numpy as np

from jflnr.files import write_atomically

# `PF` of three channels, `Pf` of one; width and height; below 0 the bytes are little-endian.
HEADER = re.compile(rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+(-?[\d.eE+]+)\s")


def named(path: Path) -> bool:
    """Whether a file of this name is one."""
    return path.suffix.lower() == ".pfm"


def read(path: Path) -> dict[str, np.ndarray]:
    """The channels R, G and B, or Y, `(H, W)` float32.

    Raises OSError for a file that cannot be opened, ValueError for one that is none.
    """
    data = path.read_bytes()
    if (header := HEADER.match(data)) is None:
        raise ValueError(f"{path} is not a PFM file")
    names, order = "RGB" if header[1] == b"PF" else "Y", "<" if header[4][:1] == b"-" else ">"
    width, height = int(header[2]), int(header[3])
    if not 0 < 4 * width * height * len(names) == len(data) - header.end():
        raise ValueError(f"{path} is a truncated or damaged PFM file")
    pixels = np.frombuffer(data, f"{order}f4", offset=header.end())
    image = pixels.reshape(height, width, len(names))[::-1].astype(np.float32)
    return {name: image[..., i] for i, name in enumerate(names)}


def write(path: Path, image: np.ndarray) -> None:
    """Write `(H, W, 3)`, whole or not at all."""
    height, width = image.shape[:2]
    header = f"PF\n{width} {height}\n-1.0\n".encode()
    write_atomically(path, header + image[::-1].astype("<f4").tobytes())
