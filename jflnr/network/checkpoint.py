"""The state of a training run in a file, from which it goes on as if nothing had happened."""

from pathlib import Path
from typing import Any

from jflnr import arrays


def save_state(path: Path, state: Any, history: list, run: dict[str, Any]) -> None:
    """Write the state, the history and what identifies the run, atomically."""
    arrays.write(path, {"run": run, "history": history}, state)


def load_state(path: Path, like: Any, run: dict[str, Any]) -> tuple[Any, list]:
    """State and history as saved. like: a state of the same structure.

    Raises `ValueError` if the file is no state, or one of another run.
    """
    header, stored = arrays.read(path, "the state of a training run")
    if header.get("run") != run:
        raise ValueError(
            f"{path}: the state of another run ({header.get('run')}); this one is {run}. "
            "Remove the file to begin anew"
        )
    if not isinstance(header.get("history"), list):
        raise ValueError(f"{path}: not the state of a training run. Remove the file")
    try:
        return arrays.restore(stored, like), header["history"]
    except ValueError as error:
        raise ValueError(f"{path}: not the state of this training run ({error})") from None
