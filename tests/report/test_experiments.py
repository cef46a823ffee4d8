"""`python -m experiments report`: one page from the JSON of experiments."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments import data, methods, report
from jflnr.frame import Frame


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch, frame_file: Path) -> list[str]:
    """Two stand-ins for denoisers, one of them not shown; the list says which were called."""
    made: list[str] = []

    def denoise(frame: Frame, name: str) -> np.ndarray:
        made.append(name)
        return 0.5 * np.asarray(frame.indirect)

    found = [methods.Method(n, "jflnr", denoise, {"name": n}, False) for n in ("flr", "other")]
    monkeypatch.setattr(report, "ours", lambda: found)
    monkeypatch.setattr(report, "peers", list)
    monkeypatch.setattr(data, "one_view_each", lambda split: [frame_file])
    return made


def evidence(parts: dict[str, Any]) -> str:
    return json.dumps([{"commit": "abc", "date": "then", "device": "this", "parts": parts}])


def test_page_of_all_results(tmp_path: Path, calls: list[str]) -> None:
    means = [
        {"method": "noisy", "psnr": 5.0},
        {"method": "flr", "psnr": 24.0, "ms": 20.0},
        {"method": "OIDN, tuned", "psnr": 24.5, "ms": float("nan")},
    ]
    (tmp_path / "methods.json").write_text(evidence({"means": means}))
    for _ in range(2):  # what was denoised is kept
        report.write(tmp_path, tmp_path / "out")
        assert calls == ["flr"]
    page = (tmp_path / "out" / "report.html").read_text()
    value = lambda name: json.loads(page.split(f"const {name} = ")[1].split(";\n")[0])
    (table,) = value("CONTENT")["tables"]
    assert table["columns"] == {"method": "method", "psnr": "PSNR dB", "ms": "ms"}
    assert [row["psnr"] for row in table["rows"]] == [5.0, 24.0, 24.5]
    assert table["note"] == "methods: commit abc, then, this"
    assert [row["family"] for row in value("CHART")["rows"]] == ["jflnr", "OIDN"]
    (scene,) = value("CONTENT")["scenes"]
    assert [image["name"] for image in scene["images"]] == ["noisy", "flr", "reference"]


def test_page_without_results_still_shows_pictures(tmp_path: Path, calls: list[str]) -> None:
    report.write(tmp_path, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert calls == ["flr"] and "Chart.js" not in page
