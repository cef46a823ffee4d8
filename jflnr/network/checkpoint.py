"""The state of a training run in a file, from which it goes on as if nothing had happened."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jflnr.files import json_object, replacing, unpacked_size


def save_state(path: Path, state: Any, history: list, run: dict[str, Any]) -> None:
    """Write the leaves of `state`, the history and what identifies the run, atomically."""
    header = json.dumps({"run": run, "history": history}).encode()
    leaves: dict[str, Any] = {
        f"leaf{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))
    }
    with replacing(path) as beside, beside.open("wb") as file:
        np.savez(file, header=np.frombuffer(header, np.uint8), **leaves)


def load_state(path: Path, like: Any, run: dict[str, Any]) -> tuple[Any, list]:
    """State and history as saved. like: a state of the same structure.

    Raises `ValueError` if the file is no state, or one of another run.
    """
    wanted, structure = jax.tree.flatten(like)
    try:
        if unpacked_size(path) > path.stat().st_size:  # it is written without compression
            raise ValueError("compressed")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            header = json_object(stored["header"].tobytes())
            leaves = [stored[f"leaf{i}"] for i in range(len(stored.files) - 1)]
    except Exception as error:  # damaged archives fail in many ways, some undocumented
        raise ValueError(f"{path}: not the state of a training run ({error})") from None
    if header.get("run") != run:
        raise ValueError(
            f"{path}: the state of another run ({header.get('run')}); this one is {run}. "
            "Remove the file to begin anew"
        )
    same = [np.shape(leaf) for leaf in wanted] == [leaf.shape for leaf in leaves]
    if not same or not isinstance(header.get("history"), list):
        raise ValueError(f"{path}: its arrays are not those of this run. Remove the file")
    return jax.tree.unflatten(structure, leaves), header["history"]
