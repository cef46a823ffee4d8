"""What pages say is what results/*.json hold."""

import json
import re
from pathlib import Path

import pytest

from experiments import pages, results
from experiments.catalogue import NAMES, experiment

DOCS = results.ROOT / "docs"
FILES = sorted(results.FOLDER.glob("*.json"))
PAGES = pages.prose(DOCS)


@pytest.fixture(scope="module")
def found() -> dict[str, list[results.Row]]:
    return pages.everything(results.FOLDER)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_figures_of_pages_are_those_of_the_results(
    page: Path, found: dict[str, list[results.Row]]
) -> None:
    """`python -m experiments pages` would change nothing."""
    text = page.read_text()
    for line, right in zip(text.splitlines(), pages.filled(text, found).splitlines(), strict=True):
        assert line == right
    for name in re.findall(r"results/(\w+)\.json", text):
        assert name in found


def test_the_argument_is_made_of_figures() -> None:
    assert len(pages.FIGURE.findall((DOCS / "results.md").read_text())) > 100


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_results_say_where_they_are_from(path: Path) -> None:
    assert path.stem in NAMES
    for measured in results.read(path):
        assert measured["commit"] and measured["date"] and measured["device"]
        assert not measured["commit"].endswith("-dirty") and "quick" not in measured
        assert all(rows for rows in measured["parts"].values())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_charts_are_drawn_from_the_results(path: Path) -> None:
    drawn = pages.drawn_from(DOCS / "figures" / f"{path.stem}.png")
    right = pages.digest_of(results.parts(results.read(path)))
    assert drawn == (right if getattr(experiment(path.stem), "charts", None) else None)


MEASURED = {
    "commit": "0" * 40,
    "date": "2026-01-02",
    "device": "an abacus",
    "parts": {"means": [{"method": "a", "spp": 1, "psnr": 20.0}, {"method": "b", "psnr": 24.5}]},
}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Results of one experiment, and a page whose figures are not theirs."""
    for name in ("results", "docs", "docs/figures"):
        (tmp_path / name).mkdir()
    results.write(tmp_path / "results" / "upsample.json", [MEASURED])
    page = (
        "<!--upsample:means:a;1:psnr-->0.0 and <!--upsample:means:b - a:psnr-->9.00, "
        "<!--upsample:means:b / a:psnr-->0, [all](../results/upsample.json)"
    )
    (tmp_path / "docs" / "page.md").write_text(page)
    (tmp_path / "README.md").write_text("")
    return tmp_path


def test_pages_are_made_from_results(site: Path) -> None:
    pages.write(site / "results", site / "docs")
    text = (site / "docs" / "page.md").read_text()
    assert re.sub("<!--.*?-->", "", text).startswith("20.0 and 4.50, 1, ")
    made = (site / "docs" / "figures" / "upsample.md").read_text()
    assert "| a | 1 | 20 |\n| b |  | 24.5 |" in made
    noted = pages.noted(text, pages.everything(site / "results"))
    assert "[all](figures/upsample.md)" in noted
    for page in (made, noted):
        assert "commit 000" in page and "2026-01-02, an abacus" in page and pages.CHANGED in page


def test_an_unknown_figure_is_an_error(site: Path) -> None:
    (site / "docs" / "page.md").write_text("<!--upsample:means:c:psnr-->1.0")
    with pytest.raises(ValueError, match="no figure upsample:means:c:psnr"):
        pages.write(site / "results", site / "docs")


def test_results_are_written_a_row_a_line(tmp_path: Path) -> None:
    rows = [{"a": 1.23456, "b": [2 / 3]}, {"a": None}]
    results.write(tmp_path / "x.json", [MEASURED | {"parts": {"means": rows}}])
    text = (tmp_path / "x.json").read_text()
    assert json.loads(text)[0]["parts"]["means"] == [{"a": 1.235, "b": [0.6667]}, {"a": None}]
    assert '\n{"a": null}\n' in text
