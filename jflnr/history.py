"""What one frame of a sequence leaves to the next, as a file: arrays, and a few words on them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jflnr.files import json_object, replacing, unpacked_size

FORMAT = "jflnr-history"
# What a file says besides the arrays.
ABOUT = {"options": dict, "last": list, "header": dict}


class History(NamedTuple):
    """The content of a file. about: what was said of it. arrays: the leaves of the state."""

    path: Path
    about: dict[str, Any]
    arrays: list[np.ndarray]

    def state(self, like: Any) -> Any:
        """The state, a pytree with the structure of `like`, which may be of another moment.

        Raises `ValueError` if it is of another method or of frames of another size.
        """
        leaves, structure = jax.tree.flatten(like)
        wanted, found = ([np.shape(leaf) for leaf in some] for some in (leaves, self.arrays))
        numbers = all(array.dtype.kind in "biuf" for array in self.arrays)
        if wanted != found or not numbers:
            raise ValueError(
                f"{self.path} is of frames of another size or with other layers than this one"
            )
        arrays = zip(self.arrays, leaves, strict=True)
        return jax.tree.unflatten(structure, [a.astype(leaf.dtype) for a, leaf in arrays])


def read(path: Path) -> History:
    """The history in a file. Raises `ValueError` if it is no such file."""
    try:
        if unpacked_size(path) > path.stat().st_size:  # it is written without compression
            raise ValueError("compressed")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            about = json_object(str(stored[FORMAT]))
            arrays = [stored[f"array{i}"] for i in range(len(stored.files) - 1)]
    except Exception:  # damaged archives fail in many ways, some undocumented
        raise ValueError(f"{path} is not a history that --history wrote, or is damaged") from None
    if not all(isinstance(about.get(name), kind) for name, kind in ABOUT.items()):
        raise ValueError(f"{path} does not say what history it is: {', '.join(ABOUT)} are wanted")
    return History(path, about, arrays)


def write(path: Path, state: Any, about: Mapping[str, Any]) -> None:
    """Write a state, atomically. about: what JSON can hold."""
    stored: dict[str, Any] = {FORMAT: np.array(json.dumps(about))}
    stored |= {f"array{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))}
    with replacing(path) as beside, beside.open("wb") as file:
        np.savez(file, **stored)
