"""A headless Chromium, and a page to look at in it."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.report import chart
from jflnr.frame import Frame
from jflnr.report.page import write_report
from jflnr.report.scenes import Scene, of_frame


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """The system's Chromium, driven by Playwright."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    programs = ("chromium", "chromium-browser", "google-chrome")
    path = next(filter(None, map(shutil.which, programs)), None)
    if path is None:
        pytest.skip(f"no Chromium is installed (none of {', '.join(programs)} is there)")
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def scene(frame: Frame) -> Scene:
    """The made-up frame in two versions: half as bright, and exact but for one pixel."""
    assert frame.reference is not None
    nearly = np.array(frame.reference)
    nearly[5, 7] = (0.25, np.nan, np.inf)
    half = 0.5 * np.asarray(frame.reference)
    return of_frame("made up", frame, {"half": half, "nearly": nearly})


@pytest.fixture
def report(scene: Scene, tmp_path: Path) -> Path:
    """A page with two scenes, a chart and a table."""
    rows = [
        {"method": "fast", "ms": 1.0, "psnr": 20.0, "flip": 0.2},
        {"method": "good", "ms": 10.0, "psnr": 30.0, "flip": 0.1},
        {"method": "poor", "ms": 5.0, "psnr": 10.0, "flip": None},
    ]
    columns = {"method": "method", "psnr": "PSNR dB", "flip": "FLIP", "ms": "ms"}
    table = {"title": "Table", "note": "made up", "columns": columns, "rows": rows}
    plain = Scene("plain", {name: image[:, :20] for name, image in scene.images.items()})
    path = tmp_path / "report.html"
    write_report(path, [scene, plain], "A <b>title</b> & more", [table], chart("Speed", rows))
    return path
