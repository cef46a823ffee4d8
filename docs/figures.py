"""A hook of MkDocs: the pages of results, made from results/*.json before the site is built."""

from pathlib import Path
from typing import Any

from experiments import pages, results

FOUND = pages.everything(results.FOLDER)


def on_pre_build(config: Any) -> None:
    """Write the tables into docs/figures; `python -m experiments pages` draws the charts."""
    pages.tables(FOUND, Path(config["docs_dir"]) / "figures")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Link the pages of results, and tell where the figures are from."""
    return pages.noted(markdown, FOUND)
