"""The list of finished frames beside them: what each is, how good, and its hash."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

NAME = "manifest.json"


class Manifest:
    """`manifest.json` of a folder: entries by file name; rewritten atomically."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.entries = self._read()

    def _read(self) -> dict[str, dict[str, Any]]:
        return json.loads(self.path.read_text())["frames"] if self.path.exists() else {}

    def done(self, name: str) -> bool:
        """Whether nothing is left to do for a frame: it is finished, or cannot be rendered."""
        entry = self.entries.get(name)
        return entry is not None and ("skipped" in entry or (self.path.parent / name).exists())

    def count(self, split: str) -> int:
        """Finished frames of a split."""
        return sum(entry.get("split") == split for entry in self.entries.values())

    def summary(self, split: str, error: float) -> str:
        """How many frames and scenes of a split there are, and how many are as good as asked."""
        frames = [entry for entry in self.entries.values() if entry.get("split") == split]
        scenes = {entry["scene"] for entry in frames}
        good = sum(e["reference_median_relative_standard_error"] <= error for e in frames)
        return (
            f"{len(frames)} frames of {len(scenes)} scenes of the split {split}; the references "
            f"of {good} have an error of at most {error:.0%}"
        )

    def add(self, name: str, facts: dict[str, Any]) -> None:
        """Record a finished frame, with the SHA-256 of its file."""
        digest = hashlib.sha256((self.path.parent / name).read_bytes()).hexdigest()
        self._set(name, facts | {"sha256": digest})

    def skip(self, name: str, reason: str) -> None:
        """Record that a frame cannot be rendered."""
        self._set(name, {"skipped": reason})

    def _set(self, name: str, entry: dict[str, Any]) -> None:
        self.entries = self._read() | {name: entry}  # another process may have added some
        self.path.parent.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_suffix(".tmp")
        beside.write_text(json.dumps({"frames": self.entries}, indent=1))
        os.replace(beside, self.path)
