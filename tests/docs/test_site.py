"""The site builds without a warning, and its code blocks run as they stand."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from sybil import Document, Example
from sybil.parsers import markdown

from experiments.pages import FIGURE
from jflnr import exr
from jflnr.cli import main
from jflnr.frame import Frame, write_frame
from jflnr.parameters import save_parameters
from jflnr.regression.flr import DEFAULT
from tests.layouts.blender_passes import passes

ROOT = Path(__file__).parents[2]
WRITTEN = (page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "figures")
PAGES = [ROOT / "README.md", *sorted(WRITTEN)]


def test_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs", reason="mkdocs is not installed")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    method = (tmp_path / "method" / "index.html").read_text()
    assert "<math" in method and "arithmatex" not in method
    assert "demodulated indirect radiance" in (tmp_path / "reference" / "index.html").read_text()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_block_has_a_language(page: Path) -> None:
    """A block without one would not be run, and nobody would notice."""
    fences = [line for line in page.read_text().splitlines() if line.startswith("```")]
    assert all(len(line) > 3 for line in fences[::2]), page
    assert len(fences) % 2 == 0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_begins_with_a_figure(page: Path) -> None:
    """A comment there ends the paragraph."""
    assert not re.findall(rf"^\s*{FIGURE.pattern}", page.read_text(), re.MULTILINE)


@pytest.fixture
def folder(tmp_path: Path, frame: Frame, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the pages' blocks run: our frames, at 1 and 4 samples, and one of Blender's."""
    monkeypatch.chdir(tmp_path)
    first = tmp_path / "room.exr"
    write_frame(first, frame)
    exr.write_channels(tmp_path / "render.exr", passes(frame))
    light = {f"indirect_4.{c}": frame.indirect[..., i] for i, c in enumerate("RGB")}
    exr.write_channels(first, exr.read_channels(first) | light)
    for name in ("a.exr", "b.exr", "frames/a.exr", "frames/b.exr", "more/c.exr", "shot/room.exr"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(first, tmp_path / name)
    save_parameters("params.json", DEFAULT, guides=["normal", "depth", "ao"])  # as `jflnr fit`
    return tmp_path


def run_shell(example: Example) -> None:
    """A script as it is, else each line of a block; `jflnr` in this process, which is quick."""
    if example.parsed.startswith("#!"):
        script = f'jflnr() {{ {sys.executable} -m jflnr "$@"; }}\n{example.parsed}'
        subprocess.run(["bash", "-c", script], check=True, env=os.environ | {"PYTHONPATH": ROOT})
        return
    for line in example.parsed.splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["jflnr"]:
            redirected = words.index(">") if ">" in words else len(words)
            assert main(words[1:redirected]) == 0, line
        elif words:
            subprocess.run(["bash", "-euc", line], check=True)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_blocks_run(page: Path) -> None:
    """All but those after `<!-- skip: next -->`, which need hours, a network or a GPU."""
    parsers = [markdown.PythonCodeBlockParser(), markdown.CodeBlockParser("bash", run_shell)]
    document = Document.parse(str(page), *parsers, markdown.SkipParser())
    for example in document.examples():
        example.evaluate()
