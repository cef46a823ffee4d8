"""What one frame of a sequence leaves to the next, as a file: arrays, and a few words on them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jflnr import arrays

FORMAT = "jflnr history"
WANTED = "a history that --history wrote"
# What a file says besides the arrays.
ABOUT = {"options": dict, "last": list, "header": dict}


class History(NamedTuple):
    """The content of a file. about: what was said of it. arrays: the leaves of the state."""

    path: Path
    about: dict[str, Any]
    arrays: dict[str, np.ndarray]

    def state(self, like: Any) -> Any:
        """The state, a pytree with the structure of `like`, which may be of another moment.

        Raises `ValueError` if it is of another method or of frames of another size.
        """
        try:
            return arrays.restore(self.arrays, like)
        except ValueError as error:
            raise ValueError(
                f"{self.path} is of frames of another size or with other layers than this one: "
                f"{error}"
            ) from None


def read(path: Path) -> History:
    """The history in a file. Raises `ValueError` if it is no such file."""
    head, stored = arrays.read(path, WANTED)
    about = head.get("about")
    if head.get("format") != FORMAT or not isinstance(about, dict):
        raise ValueError(f"{path}: not {WANTED}")
    if not all(isinstance(about.get(name), kind) for name, kind in ABOUT.items()):
        raise ValueError(f"{path} does not say what history it is: {', '.join(ABOUT)} are wanted")
    return History(path, about, stored)


def write(path: Path, state: Any, about: Mapping[str, Any]) -> None:
    """Write a state, atomically. about: what JSON can hold."""
    arrays.write(path, {"format": FORMAT, "about": dict(about)}, state)
