"""Trees of arrays in a file: a plain .npz, with a header of JSON. Nothing is ever unpickled."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jflnr.files import json_object, replacing, unpacked_size

HEADER = "header"


def write(path: str | Path, header: Mapping[str, Any], tree: Any, compress: bool = False) -> None:
    """Write a pytree, whole or not at all, each leaf under its name. header: what JSON can hold."""
    arrays: dict[str, Any] = {HEADER: np.frombuffer(json.dumps(header).encode(), np.uint8)}
    arrays |= {name: np.asarray(leaf) for name, leaf in _leaves(tree).items()}
    save = np.savez_compressed if compress else np.savez
    with replacing(path) as beside, beside.open("wb") as file:
        save(file, **arrays)


def read(
    path: str | Path, wanted: str, largest: int | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a file that `write` wrote.

    wanted: what the file should be, for messages. largest: bytes that it may unpack to; by default
    its own size, which is right for what is not compressed.
    Raises `ValueError`, in one sentence, if it is no such file.
    """
    path = Path(path)
    if not path.exists():
        raise ValueError(f"{path}: there is no such file; it should be {wanted}")
    try:
        if unpacked_size(path) <= (path.stat().st_size if largest is None else largest):
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            return json_object(arrays.pop(HEADER).tobytes()), arrays
    except Exception:  # damaged archives fail in many ways, some undocumented
        raise ValueError(f"{path}: not {wanted}, or damaged") from None
    raise ValueError(f"{path}: unpacks to too much; it should be {wanted}")


def restore(arrays: Mapping[str, np.ndarray], like: Any) -> Any:
    """The pytree, with the structure and the types of `like`.

    Raises `ValueError`, naming an array, if the names or shapes are others.
    """
    leaves = _leaves(like)
    shapes = {name: np.shape(leaf) for name, leaf in leaves.items()}
    found = {name: array.shape for name, array in arrays.items()}
    if odd := sorted(n for n in found | shapes if found.get(n) != shapes.get(n)):
        name = odd[0]
        raise ValueError(
            f"array {name[:80]} has shape {found.get(name)} and should have {shapes.get(name)}"
        )
    restored = [np.asarray(arrays[n], getattr(x, "dtype", None)) for n, x in leaves.items()]
    return jax.tree.unflatten(jax.tree.structure(like), restored)


def _leaves(tree: Any) -> dict[str, Any]:
    named = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in named}
