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


def evidence(result: dict[str, Any]) -> str:
    environment = {"command": "python -m experiments run table1", "time": "then"}
    environment |= {"processor": "this", "commit": "abc"}
    return json.dumps({"environment": environment, "quick": False, "result": result})


def test_page_of_all_results(tmp_path: Path, calls: list[str]) -> None:
    out = tmp_path / "out"
    out.mkdir()
    means = [
        {"method": "noisy", "psnr": 5.0},
        {"method": "flr", "psnr": 24.0, "ms": 20.0, "nested": [1]},
        {"method": "OIDN, tuned", "psnr": 24.5, "ms": float("nan")},
    ]
    (out / "table1.json").write_text(evidence({"means": means, "other": 3}))
    for _ in range(2):  # what was denoised is kept
        report.write(out, ["table1", "pareto"])
        assert calls == ["flr"]
    page = (out / "report.html").read_text()
    content = page.split("const CONTENT = ")[1].split(";\n")[0]
    found = json.loads(content)
    (table,) = found["tables"]
    assert table["columns"] == {"method": "method", "psnr": "PSNR dB", "ms": "ms"}
    assert [row["psnr"] for row in table["rows"]] == [5.0, 24.0, 24.5]
    assert "python -m experiments run table1" in table["note"]
    assert [row["family"] for row in found["chart"]["rows"]] == ["jflnr", "OIDN"]
    (scene,) = found["scenes"]
    assert [image["name"] for image in scene["images"]] == ["noisy", "flr", "reference"]


def test_page_without_results_still_shows_pictures(tmp_path: Path, calls: list[str]) -> None:
    report.write(tmp_path, ["table1"])
    page = (tmp_path / "report.html").read_text()
    assert calls == ["flr"] and '"chart": null' in page and "Chart.js" not in page
