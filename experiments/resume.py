"""Long experiments, row by row: progress is shown, and what is done survives an interruption."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jflnr.files import write_atomically

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "cache" / "experiments"


def rows(name: str, keys: Sequence[str], function: Callable[[str], Any]) -> list[Any]:
    """`[function(key) for key in keys]`, where values that an interrupted run left are not redone.

    name: the experiment's, with what tells this part of it from others. The values must be JSON.
    What was made by other code, or for other keys, is not used.
    """
    path = FOLDER / f"{name}.json"
    code = code_version()
    done = _read(path, code)
    for key in tqdm(keys, desc=name, disable=None, leave=False):
        if key not in done:
            # Through JSON, so that a resumed run gives exactly what an unbroken one does.
            done[key] = json.loads(json.dumps(function(key)))
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, json.dumps({"code": code, "done": done}).encode())
    return [done[key] for key in keys]


def forget(name: str) -> None:
    """Drop what is kept of a finished experiment."""
    for path in FOLDER.glob(f"{name}*.json"):
        path.unlink(missing_ok=True)


def code_version() -> str:
    """A digest of the code that results depend on."""
    code = ("jflnr/**/*.py", "experiments/**/*.py")
    patterns = (*code, "kernels_cl/**/*.cl", "kernels_cl/**/*.h")
    digest = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in ROOT.glob(pattern)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _read(path: Path, code: str) -> dict[str, Any]:
    try:
        kept = json.loads(path.read_bytes())
    except (OSError, json.JSONDecodeError):
        return {}
    return kept["done"] if kept.get("code") == code else {}
