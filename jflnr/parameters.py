"""The small file that the numbers of a method are kept in."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from jflnr import checks
from jflnr.files import write_atomically
from jflnr.methods import method_of

FORMAT = "jflnr-parameters"
VERSION = 1
METHODS = ("flr", "flr-adaptive")
LARGEST = 1 << 20  # bytes of a file that are looked at


def numbers_of(method: Any) -> dict[str, float]:
    """The numbers of a method by name, but for those of a network."""
    fields = [f.name for f in dataclasses.fields(method) if not f.metadata.get("static")]
    values = {name: getattr(method, name) for name in fields}
    return {n: float(v) for n, v in values.items() if v is not None and not isinstance(v, dict)}


def save_parameters(path: str | Path, method: Any, **about: Any) -> None:
    """Write the numbers of `FLR` or `AdaptiveFLR` as JSON, with anything else worth knowing."""
    head = {"format": FORMAT, "version": VERSION, "method": method.name}
    text = json.dumps(head | numbers_of(method) | about, indent=2)
    write_atomically(path, (text + "\n").encode())


def load_parameters(path: str | Path) -> tuple[Any, dict[str, Any]]:
    """The method with its numbers, and the rest of the file; `ValueError` if it is no such file."""
    wanted = f"a JSON file that `jflnr fit` wrote (format {FORMAT!r}, version {VERSION})"
    try:
        if not Path(path).is_file() and Path(path).exists():
            raise ValueError("it is a pipe, a device or a folder")  # whose reading may never end
        with open(path, "rb") as file:
            text = json.loads(file.read(LARGEST))
    except FileNotFoundError:
        raise ValueError(f"{path}: there is no such file; --params wants {wanted}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: cannot be read ({error}); it should be {wanted}") from None
    if not isinstance(text, dict) or text.get("format") != FORMAT or text.get("version") != VERSION:
        raise ValueError(f"{path}: not a parameter file; it should be {wanted}")
    name = text.get("method", "flr")
    if name not in METHODS:
        raise ValueError(f"{path}: its method is {name!r:.80}; it should be {' or '.join(METHODS)}")
    names = list(numbers_of(method_of(name)))
    if not all(type(text.get(number)) in (int, float) for number in names):
        raise ValueError(
            f"{path}: {', '.join(names)} must all be there as numbers; it should be {wanted}"
        )
    try:
        _check_use(text)
        return method_of(name, **{number: float(text[number]) for number in names}), text
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"{path}: {error}") from None


def _check_use(about: dict[str, Any]) -> None:
    """Raise unless the guides and the block that a file names, if it does, are such."""
    from jflnr.images.guides import NAMES

    guides = about.get("guides", [])
    if not isinstance(guides, list) or not all(guide in NAMES for guide in guides):
        raise ValueError(
            f"guides must be a list of names out of {', '.join(NAMES)}; got {guides!r:.80}"
        )
    checks.positive_integer("block", about.get("block", 1))
