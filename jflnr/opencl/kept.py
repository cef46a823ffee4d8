"""Compiled programs on disk, with the code of every kernel that has run: a processor's driver keeps
less, and takes a tenth of a second for each program in every process."""

import hashlib
import os
from pathlib import Path
from typing import Any

import platformdirs

from jflnr.files import replacing

# Bytes that are kept; those used longest ago go first.
MOST = 1 << 27
# Bytes that a file starts with, to tell whether the rest is what was written.
DIGEST = hashlib.sha256().digest_size


def folder() -> Path | None:
    """Where programs are kept: beside what PoCL keeps where its variables say so, or nowhere if
    they say that it keeps nothing."""
    if os.environ.get("POCL_KERNEL_CACHE") == "0":
        return None
    return Path(os.environ.get("POCL_CACHE_DIR") or platformdirs.user_cache_dir("jflnr"), "opencl")


def place_of(device: Any, text: str, options: list[str]) -> Path | None:
    """Where the program of this source and these options is kept for the device, if anywhere."""
    if (home := folder()) is None:
        return None
    driver = device.platform.version, device.name, device.driver_version, device.version
    key = hashlib.sha256("\0".join([*driver, *options, text]).encode()).hexdigest()
    return home / key[:32]


def read(place: Path) -> bytes | None:
    """What is kept there, and is now the last used; None if it is damaged: drivers crash then."""
    try:
        kept = place.read_bytes()
        place.touch()
    except OSError:
        return None
    told, binary = kept[:DIGEST], kept[DIGEST:]
    return binary if told == hashlib.sha256(binary).digest() else None


def write(place: Path, binary: bytes) -> None:
    """Keep a program, unless the folder does not allow it."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with replacing(place) as beside:
            beside.write_bytes(hashlib.sha256(binary).digest() + binary)
        kept = sorted(
            ((path.stat().st_mtime, path.stat().st_size, path) for path in place.parent.iterdir()),
            reverse=True,
        )
        size = 0
        for _, added, path in kept:
            if (size := size + added) > MOST:
                path.unlink(missing_ok=True)
    except OSError:  # a full disk, or another process that removes the same file
        pass
