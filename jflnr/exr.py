"""EXR files as a flat dictionary of channels, and back.

Layers are split at the last dot (`albedo.R` is channel R of layer `albedo`). A channel of a
multi-part file keeps its name when that holds a layer; otherwise its part's name is the layer.
A file called `.pfm` is read and written as plain R, G, B in that format.
Whatever is wrong with a file is raised as OSError or ValueError, in one sentence.
"""

import contextlib
import errno
import io
import itertools
import os
import struct
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenEXR

from jflnr import pfm
from jflnr.files import replacing

PathLike = str | os.PathLike[str]

COMPONENTS = "RGBAXYZ"
TYPES = {"float16": "half", "float32": "float", "uint32": "uint"}
MAGIC = b"\x76\x2f\x31\x01"
DATA_WINDOW = b"dataWindow\0box2i\0\x10\0\0\0"  # what comes before its four numbers
# Attributes that say how the pixels are stored; `comments` is told apart from the others.
STRUCTURE = (
    *("channels", "chunkCount", "comments", "compression", "dataWindow", "displayWindow"),
    *("lineOrder", "name", "tiles", "type", "version"),
)
# A small damaged header can announce any size. No real frame packs better than this.
ALWAYS_ALLOWED_BYTES = 1 << 30
PACKED_AT_MOST = 1000
# Pixels; OpenEXR takes memory for a tile also where the image is smaller.
LARGEST_TILE = 1 << 22
# Texts of a header that are not UTF-8.
MOST_TEXTS = 100


class Window(NamedTuple):
    """Where an image lies: its first pixel, and the display window (x0, y0, x1, y1), inclusive."""

    origin: tuple[int, int] = (0, 0)
    display: tuple[int, int, int, int] | None = None


class Attributes(NamedTuple):
    """What the header says besides the pixels."""

    comments: str
    compression: str
    parts: int
    window: Window
    others: dict[str, Any]  # as the program that wrote the file named them
    size: tuple[int, int]  # height and width in pixels
    names: tuple[str, ...] = ()  # of all channels


def layer_of(channel: str) -> str:
    """The layer of a channel name, split at the last dot; "" for a plain `R`, `G`, `B`."""
    return channel.rpartition(".")[0]


def layers_of(channels: Iterable[str]) -> dict[str, list[str]]:
    """The components of each layer, as people order them: {"normal": ["X", "Y", "Z"]}."""
    layers: dict[str, list[str]] = {}
    for name in sorted(channels, key=lambda name: (COMPONENTS.find(name[-1:]), name)):
        layers.setdefault(layer_of(name), []).append(name.rpartition(".")[2])
    return dict(sorted(layers.items()))


def read_attributes(path: PathLike) -> Attributes:
    """Comments, compression and windows of the file's first part, without its pixels."""
    if pfm.named(Path(path)):
        channels = read_channels(path)
        size = next(iter(channels.values())).shape
        return Attributes("", "NO", 1, Window(), {}, size, tuple(channels))
    parts = _parts(Path(path), header_only=True)
    header = parts[0].header
    (x0, y0), (x1, y1) = header["dataWindow"]
    low, high = header["displayWindow"]
    comments = header.get("comments")
    return Attributes(
        comments=comments if isinstance(comments, str) else "",
        compression=header["compression"].name.removesuffix("_COMPRESSION"),
        parts=len(parts),
        window=Window((int(x0), int(y0)), (int(low[0]), int(low[1]), int(high[0]), int(high[1]))),
        others={name: value for name, value in header.items() if name not in STRUCTURE},
        size=(int(y1) - int(y0) + 1, int(x1) - int(x0) + 1),
        names=tuple(_named(parts)),
    )


def read_channels(path: PathLike) -> dict[str, np.ndarray]:
    """Every channel of every part, (H, W), in its own type (float16, float32 or uint32).

    Raises OSError when there is no such file, ValueError when it cannot be used.
    """
    path = Path(path)
    if pfm.named(path):
        _check_there(path)
        return pfm.read(path)
    parts = _parts(path, header_only=False)
    channels = _named(parts)
    check_sizes(path, channels)
    if len({tuple(map(int, part.header["dataWindow"][0])) for part in parts}) > 1:
        raise ValueError(f"{path}: its parts do not start at the same pixel")
    return channels


def check_aligned(*paths: PathLike) -> None:
    """Raise ValueError unless the pixels of all files are those of the same data window."""
    starts = [(path, read_attributes(path).window.origin) for path in paths]
    for (first, origin), (other, start) in itertools.pairwise(starts):
        if start != origin:
            raise ValueError(
                f"{first} starts at pixel {origin} and {other} at {start}: "
                "they do not cover the same pixels"
            )


def write_channels(
    path: PathLike,
    channels: Mapping[str, np.ndarray],
    comments: str | None = None,
    window: Window | None = None,
    others: Mapping[str, Any] | None = None,
) -> None:
    """Write (H, W) channels of float16, float32 or uint32 as one part, atomically.

    `window` places the image; without it, it starts at 0, 0 and fills the display window.
    `others` are further attributes of the header. A file of float32 alone is not compressed: the
    digits of computed light do not repeat, so RLE saves a hundredth in three times the time.
    """
    path = Path(path)
    check_sizes(path, channels)
    if wrong := [f"{n} is {a.dtype}" for n, a in channels.items() if a.dtype.name not in TYPES]:
        raise TypeError(f"channels must be {', '.join(TYPES)}; {wrong[0]}")
    if pfm.named(path):
        return pfm.write(path, np.stack([channels[name] for name in "RGB"], axis=-1))
    size = next(iter(channels.values())).shape
    computed = all(pixels.dtype == np.float32 for pixels in channels.values())
    compression = OpenEXR.NO_COMPRESSION if computed else OpenEXR.ZIP_COMPRESSION
    header = _header(size, comments, window, others) | {"compression": compression}
    with replacing(path) as beside:
        _write(beside, header, channels)


@contextlib.contextmanager
def writing_rows(
    path: PathLike,
    size: tuple[int, int],
    types: Mapping[str, Any],
    comments: str | None = None,
    window: Window | None = None,
    others: Mapping[str, Any] | None = None,
) -> Iterator[Callable[[Mapping[str, np.ndarray]], None]]:
    """A function that appends rows to a file of height and width `size`, which is there at the end.

    types: the dtype of each channel; all else as for `write_channels`, without compression.
    """
    names, width = sorted(types, key=str.encode), size[1]
    pixels = np.dtype([(name, np.dtype(types[name]).newbyteorder("<"), width) for name in names])
    row = np.dtype([("y", "<i4"), ("bytes", "<i4"), ("pixels", pixels)])
    header = _header(size, comments, window, others) | {"compression": OpenEXR.NO_COMPRESSION}
    y = (window or Window()).origin[1]
    with replacing(Path(path)) as beside, beside.open("wb") as file:
        start = _header_bytes(header, types)
        table = len(start) + 8 * size[0] + row.itemsize * np.arange(size[0])
        file.write(start + table.astype("<u8").tobytes())

        def append(channels: Mapping[str, np.ndarray]) -> None:
            nonlocal y
            rows = np.empty(len(channels[names[0]]), row)
            rows["y"], rows["bytes"] = y + np.arange(len(rows)), pixels.itemsize
            for name in names:
                rows["pixels"][name] = channels[name]
            file.write(rows.tobytes())
            y += len(rows)

        yield append


def _header(
    size: tuple[int, ...],
    comments: str | None,
    window: Window | None,
    others: Mapping[str, Any] | None,
) -> dict[str, Any]:
    """The header of an image of height and width `size`, but for its compression."""
    (x, y), display = window or Window()
    corners = (x, y, x + size[1] - 1, y + size[0] - 1)
    box = lambda ends: (np.array(ends[:2], np.int32), np.array(ends[2:], np.int32))
    header = dict(others or {}) | {
        "type": OpenEXR.scanlineimage,
        "dataWindow": box(corners),
        "displayWindow": box(display or corners),
    }
    return header if comments is None else header | {"comments": comments}


def _header_bytes(header: dict[str, Any], types: Mapping[str, Any]) -> bytes:
    """What a file without compression starts with: that of one pixel, with the whole data window.

    Behind it that has an offset, the row's number and size, and the pixel.
    """
    pixel = {name: np.zeros((1, 1), dtype) for name, dtype in types.items()}
    low, high = header["dataWindow"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pixel.exr"
        _write(path, header | {"dataWindow": (low, low)}, pixel)
        start = path.read_bytes()[: -16 - sum(value.itemsize for value in pixel.values())]
    return start.replace(
        DATA_WINDOW + low.tobytes() * 2, DATA_WINDOW + low.tobytes() + high.tobytes()
    )


def _write(path: Path, header: dict[str, Any], channels: Mapping[str, np.ndarray]) -> None:
    contiguous = {name: np.ascontiguousarray(pixels) for name, pixels in channels.items()}
    try:
        with _silence():
            OpenEXR.File(header, contiguous).write(os.fsencode(path))
    except RuntimeError as error:  # 'Cannot open image file "...". No space left on device.'
        raise OSError(errno.EIO, str(error).rpartition('". ')[2].rstrip(".")) from None


class _Part(NamedTuple):
    name: str
    header: dict[str, Any]
    channels: dict[str, np.ndarray]


def _named(parts: list[_Part]) -> dict[str, np.ndarray]:
    """The channels of all parts."""
    channels: dict[str, np.ndarray] = {}
    for part in parts:
        for name, pixels in part.channels.items():
            layered = "." in name or len(parts) == 1
            channels[name if layered and name not in channels else f"{part.name}.{name}"] = pixels
    return channels


def _parts(path: Path, header_only: bool) -> list[_Part]:
    """All parts, whose headers are checked before pixels are read.

    OpenEXR takes no texts or names that are not UTF-8. In the copy that it then gets, letters
    beyond ASCII are tildes, which sort where they do; the texts are put back, taken as Latin-1.
    """
    _check_file(path)
    texts: dict[str, str] = {}
    data, place, announced = b"", path, None
    with _silence(), tempfile.TemporaryDirectory() as folder:
        try:
            while announced is None:
                try:
                    announced = _read(place, texts, header_only=True)
                except UnicodeDecodeError as error:
                    data, text = data or path.read_bytes(), error.object
                    plain = bytes(byte if byte < 128 else ord("~") for byte in text)
                    texts[plain.decode()] = text.decode("latin-1")
                    length = struct.pack("<i", len(text))
                    before, data = data, data.replace(length + text, length + plain)
                    if data == before:  # a name, which ends with 0; the header comes first
                        data = data.replace(text + b"\0", plain + b"\0", 1)
                    if data == before or len(texts) > MOST_TEXTS:
                        raise
                    place = Path(folder) / "copy.exr"
                    place.write_bytes(data)
            for part in announced:
                _check_header(path, part)
            parts = announced if header_only else _read(place, texts, header_only=False)
            if len(parts) != len(announced):
                raise ValueError(f"{path} is truncated or damaged: its pixels cannot be read")
            return parts
        except Exception as error:  # RuntimeError, TypeError, MemoryError, ...
            if str(error).startswith(str(path)):
                raise  # a sentence of ours
            raise ValueError(_why_unreadable(path)) from error


def _read(path: Path, texts: Mapping[str, str], header_only: bool) -> list[_Part]:
    """texts: what some texts and names of the file stand for."""
    named = lambda text: texts.get(text, text)
    file = OpenEXR.File(os.fsencode(path), separate_channels=True, header_only=header_only)
    parts = []
    for i, part in enumerate(file.parts):
        header = file.header(i)
        stored = header["channels"] if header_only else part.channels.values()
        header = {named(n): named(v) if isinstance(v, str) else v for n, v in header.items()}
        channels = {named(channel.name): channel.pixels for channel in stored}
        parts.append(_Part(part.name(), header, channels))
    return parts


def latin_1(name: str) -> str:
    """A name whose bytes are not UTF-8, and so surrogates, taken as Latin-1; others as they are."""
    return name if name.isprintable() else name.encode(errors="surrogateescape").decode("latin-1")


def _check_there(path: Path) -> None:
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file")
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, not an EXR file")
    if not path.is_file():
        raise OSError(f"{path} is a pipe or a device, not an EXR file")


def _check_file(path: Path) -> None:
    _check_there(path)
    try:
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
    except OSError as error:
        raise OSError(f"{path} cannot be read: {error.strerror}.") from None
    if not start:
        raise ValueError(f"{path} is empty (0 bytes), not an EXR file")
    if start != MAGIC:
        raise ValueError(f"{path} is not an EXR file")


def _why_unreadable(path: Path) -> str:
    """OpenEXR only says that it could not open the file. The usual reasons can be told apart."""
    with path.open("rb") as file:
        _, found, after = file.read(1 << 16).partition(DATA_WINDOW)
    if found and len(after) >= 16:
        x0, y0, x1, y1 = struct.unpack("<4i", after[:16])
        if x1 < x0 or y1 < y0:
            return f"{path} has zero size: its data window is {x0}, {y0} to {x1}, {y1}"
    return f"{path} is a truncated or damaged EXR file: its header cannot be read"


def _check_header(path: Path, part: _Part) -> None:
    """Refuse, before any memory is asked for, what cannot be an image of a renderer."""
    if part.header["type"] in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise ValueError(f"{path} holds deep pixels; flatten it first")
    (x0, y0), (x1, y1) = part.header["dataWindow"]
    width, height = int(x1) - int(x0) + 1, int(y1) - int(y0) + 1
    channels, tiles = len(part.header["channels"]), part.header.get("tiles")
    if tiles is not None and tiles.xSize * tiles.ySize > max(width * height, LARGEST_TILE):
        raise ValueError(
            f"{path} is damaged: its header announces tiles of {tiles.xSize} x {tiles.ySize} pixels"
        )
    size = path.stat().st_size
    if 4 * width * height * channels > max(ALWAYS_ALLOWED_BYTES, PACKED_AT_MOST * size):
        raise ValueError(
            f"{path} is damaged: its header announces {width} x {height} pixels of {channels} "
            f"channels, which its {size} bytes cannot hold"
        )


def check_sizes(path: Path, channels: Mapping[str, np.ndarray]) -> None:
    """Raise ValueError, naming `path`, unless all channels are of one size that is not zero."""
    sizes = {pixels.shape: name for name, pixels in channels.items()}
    if not sizes or any(0 in size for size in sizes):
        raise ValueError(f"{path} has zero size: there are no pixels in it")
    if len(sizes) > 1:
        listed = ", ".join(f"{name} is {w} x {h}" for (h, w), name in sizes.items())
        raise ValueError(f"{path}: sizes disagree (width x height): {listed}")


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep OpenEXR's own remarks off the terminal: it prints to stdout and, from C, to stderr.

    Several threads may read and write at a time: the first closes both, the last opens them again.
    """
    with _lock:
        if not _silent:
            _hush()
        _silent.append(None)
    try:
        yield
    finally:
        with _lock:
            _silent.pop()
            if not _silent:
                _opening.close()


_lock = threading.Lock()
_silent: list[None] = []  # one entry for each thread that wants silence
_opening = contextlib.ExitStack()  # what opens both again


def _hush() -> None:
    saved = os.dup(2)
    _opening.callback(os.close, saved)
    _opening.callback(os.dup2, saved, 2)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    _opening.enter_context(contextlib.redirect_stdout(io.StringIO()))
