"""Weights of the network in a file: arrays of numpy in half precision, and what they are.

The file is a plain .npz. Nothing in it is ever unpickled, and a file that is not exactly what the
network needs is refused.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.files import json_object, replacing, unpacked_size
from jflnr.network import features, flnr, unet

FORMAT, VERSION = "jflnr network", 2
# More than any network here has; a file that says it unpacks to more is not read.
LARGEST = 64 * 2**20
FOLDER = Path(__file__).parent / "weights"


def save(path: str | Path, params: unet.Params, widths: tuple[int, ...], **about: Any) -> None:
    """Write weights in half precision. about: anything else worth knowing, such as the score."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "widths": list(widths),
        "guides": list(features.GUIDES),
        "features": features.COUNT,
        **about,
    }
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    arrays: dict[str, Any] = {name: np.asarray(value, np.float16) for name, value in params.items()}
    with replacing(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, header=text, **arrays)


def load(path: str | Path) -> tuple[unet.Params, dict[str, Any]]:
    """Weights in float32, and the header; `ValueError` in one sentence if it is no such file."""
    arrays = _arrays(Path(path))
    header = _header(path, arrays.pop("header", None))
    wanted = _shapes(tuple(header["widths"]))
    found = {name: array.shape for name, array in arrays.items()}
    if found != wanted:
        odd = sorted(name for name in found | wanted if found.get(name) != wanted.get(name))[0]
        raise ValueError(
            f"{path}: array {odd} has shape {found.get(odd)} and the network of widths "
            f"{header['widths']} needs {wanted.get(odd)}"
        )
    for name, array in arrays.items():
        if array.dtype != np.float16 or not np.isfinite(array).all():
            raise ValueError(f"{path}: array {name} must hold finite half-precision numbers")
    return {name: jnp.asarray(array, jnp.float32) for name, array in arrays.items()}, header


@functools.cache
def shipped(method: str) -> unet.Params:
    """The weights that come with the package."""
    return load(FOLDER / f"{method}.npz")[0]


def _arrays(path: Path) -> dict[str, np.ndarray]:
    wanted = "it should be a file of weights that `jflnr train` wrote"
    if not path.exists():
        raise ValueError(f"{path}: there is no such file; {wanted}")
    try:
        size = unpacked_size(path)
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            if size <= LARGEST:
                return {name: stored[name] for name in stored.files}
    except Exception:  # damaged archives fail in many ways, some undocumented
        raise ValueError(f"{path}: cannot be read, or is damaged; {wanted}") from None
    raise ValueError(f"{path}: unpacks to more than any network here needs; {wanted}")


def _header(path: str | Path, text: np.ndarray | None) -> dict[str, Any]:
    header = json_object(b"" if text is None else text.tobytes())
    if header.get("format") != FORMAT:
        raise ValueError(f"{path}: not a file of weights that `jflnr train` wrote")
    known = {"version": VERSION, "features": features.COUNT, "guides": list(features.GUIDES)}
    for name, wanted in known.items():
        if header.get(name) != wanted:
            raise ValueError(
                f"{path}: {name} is {header.get(name)}; this jflnr reads {wanted}, so train anew"
            )
    widths = header.get("widths")
    if (
        not isinstance(widths, list)
        or not 2 <= len(widths) <= 8
        or not all(type(width) is int and 0 < width <= 512 for width in widths)
    ):
        raise ValueError(f"{path}: widths is {widths!r}; it must be two to eight positive integers")
    return header


def _shapes(widths: tuple[int, ...]) -> dict[str, tuple[int, ...]]:
    params = jax.eval_shape(lambda key: flnr.init(key, widths), jax.random.key(0))
    return {name: value.shape for name, value in params.items()}
