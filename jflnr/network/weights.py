"""Weights of the network in a file: arrays of numpy in half precision, and what they are.

The file is a plain .npz. Nothing in it is ever unpickled, and a file that is not exactly what the
network needs is refused.
"""

import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import arrays
from jflnr.network import features, flnr, unet
from jflnr.network.features import Read

FORMAT, VERSION = "jflnr network", 3
# More than any network here has; a file that says it unpacks to more is not read.
LARGEST = 64 * 2**20
WANTED = "a file of weights that `jflnr train` wrote"
FOLDER = Path(__file__).parent / "weights"


def save(
    path: str | Path, params: unet.Params, widths: tuple[int, ...], read: Any = Read, **about: Any
) -> None:
    """Write weights in half precision. read: what the network reads, as `features.Read`. about:
    anything else worth knowing, such as the score."""
    header = {"format": FORMAT, "widths": list(widths), **_known(read), **about}
    half = {name: np.asarray(value, np.float16) for name, value in params.items()}
    arrays.write(path, header, half, compress=True)


def load(path: str | Path, read: Any = Read) -> tuple[unet.Params, dict[str, Any]]:
    """Weights in float32, and the header; `ValueError` in one sentence if it is no such file.

    read: what the network is to read.
    """
    header, stored = arrays.read(path, WANTED, LARGEST)
    widths = _widths(path, header, read)
    for name, array in stored.items():
        if array.dtype != np.float16 or not np.isfinite(array).all():
            raise ValueError(f"{path}: array {name} must hold finite half-precision numbers")
    like = jax.eval_shape(lambda key: flnr.init(key, widths, read), jax.random.key(0))
    try:
        return jax.tree.map(jnp.asarray, arrays.restore(stored, like)), header
    except ValueError as error:
        raise ValueError(f"{path}: {error} in the network of widths {list(widths)}") from None


@functools.cache
def shipped(method: str, read: Any = Read) -> unet.Params:
    """The weights that come with the package. read: as of `load`."""
    with jax.ensure_compile_time_eval():  # they are kept, also if a function that is traced asks
        return load(FOLDER / f"{method}.npz", read)[0]


def _known(read: Any) -> dict[str, Any]:
    """What a header says of what the network reads."""
    counts = [read.PIXEL, features.POOLED]
    return {"version": VERSION, "guides": list(read.GUIDES), "features": counts}


def _widths(path: str | Path, header: dict[str, Any], read: Any) -> tuple[int, ...]:
    """Those of a header that this version reads."""
    if header.get("format") != FORMAT:
        raise ValueError(f"{path}: not {WANTED}")
    for name, wanted in _known(read).items():
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
    return tuple(widths)
