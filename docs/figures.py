"""A hook of MkDocs: the pages of results, made from results/*.json before the site is built."""

from pathlib import Path
from typing import Any

from experiments import pages, results


def on_pre_build(config: Any) -> None:
    """Write docs/figures."""
    pages.write(results.FOLDER, Path(config["docs_dir"]))


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Link the pages of results, and tell where the figures are from."""
    return pages.noted(markdown, results.FOLDER)
