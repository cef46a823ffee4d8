"""Where the frames are, split by scene."""

from __future__ import annotations

import os
from pathlib import Path

from jflnr.denoising import SHIPPED_FRAME as SHIPPED


def folder() -> Path:
    """JFLNR_DATA, else `shared/data` beside the repository."""
    default = Path(__file__).parents[2] / "shared" / "data"
    return Path(os.environ.get("JFLNR_DATA", default))


def frames(*splits: str) -> list[Path]:
    """The frames of the splits (train, val, test); the one that ships if there are none here."""
    found = [path for split in splits for path in sorted((folder() / split).glob("*.exr"))]
    if not found:
        print(f"No frames in {folder()} (set JFLNR_DATA): using the one that ships with jflnr.")
        return [SHIPPED]
    return found


def label(path: Path) -> str:
    """split/scene_view, as in the published baselines."""
    return f"{path.parent.name}/{path.stem}"
