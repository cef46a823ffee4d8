"""Writing files so that nothing is ever half-written, and bounds for what is read from them."""

import json
import os
import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Deeper than any JSON of ours or of a renderer; what is deeper cannot be written again either.
DEEPEST = 50
# Files and folders to remove where the process ends in the midst of writing.
unfinished: set[Path] = set()


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A path beside `path` to write to; it takes the place of `path` only if all went well.

    Raises OSError that names `path` where the disk, or who guards it, says no.
    """
    path = Path(path)
    if path.exists() and not path.is_file():  # whoever may would replace /dev/null
        raise OSError(f"{path} cannot be written: it is a folder, a pipe or a device")
    # What mkstemp adds, 10 letters with ours, may be too many for the file system.
    prefix = f".{path.stem[:-10]}-"
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=path.suffix, dir=path.parent)
        os.close(handle)
        with removed(beside := Path(name)):
            yield beside
            # A temporary file is private; what we leave behind follows the user's own umask.
            mask = os.umask(0)
            os.umask(mask)
            beside.chmod(0o666 & ~mask)
            beside.replace(path)
    except OSError as error:
        if error.strerror is None:  # a sentence of ours
            raise
        raise OSError(f"{path} cannot be written: {error.strerror}") from None


@contextmanager
def removed(path: Path) -> Iterator[None]:
    """A file or folder that is not left behind, however this ends."""
    unfinished.add(path)
    try:
        yield
    finally:
        remove(path)
        unfinished.discard(path)


def remove(path: Path) -> None:
    """A file, or a folder with what is in it; it need not be there."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def write_atomically(path: str | Path, data: bytes) -> None:
    """Write `data` to `path`, whole or not at all."""
    with replacing(path) as beside:
        beside.write_bytes(data)


def json_object(text: str | bytes) -> dict[str, Any]:
    """The JSON object that `text` is, which nobody vouches for; {} if it is none."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) and not _deeper(found, DEEPEST) else {}


def _deeper(value: Any, levels: int) -> bool:
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return levels == 0 or any(_deeper(item, levels - 1) for item in items)


def unpacked_size(path: Path) -> int:
    """Bytes that the members of a .npz unpack to, by its directory; numpy reads no more of them."""
    if not path.is_file():
        raise ValueError("a pipe or a folder")  # reading a pipe may never end
    with zipfile.ZipFile(path) as members:
        return sum(member.file_size for member in members.infolist())
