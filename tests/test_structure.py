"""The folders of the package form layers; what is copied without the package says its licence."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import jflnr

ROOT = Path(jflnr.__file__).parent


def node_of(name: str) -> str | None:
    """The folder or top-level module of a dotted name; None for the package itself or another."""
    package, _, rest = name.partition(".")
    part = rest.partition(".")[0]
    known = (ROOT / part).is_dir() or (ROOT / f"{part}.py").is_file()
    return part if package == "jflnr" and part and known else None


def imports(tree: ast.AST) -> Iterator[str]:
    """Dotted names that are imported anywhere, also in functions, but for types alone."""
    for child in ast.iter_child_nodes(tree):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        if isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom) and child.module:
            yield from (f"{child.module}.{alias.name}" for alias in child.names)
        yield from imports(child)


def test_no_folder_needs_itself_by_way_of_others() -> None:
    needs: dict[str, set[str]] = {}
    for path in ROOT.rglob("*.py"):
        inside = path.relative_to(ROOT)
        node = inside.parts[0].removesuffix(".py")
        found = {node_of(name) for name in imports(ast.parse(path.read_text()))}
        needs.setdefault(node, set()).update(found - {None, node})
    assert needs["large"] and needs["denoising"]
    TopologicalSorter(needs).prepare()


def test_what_an_engine_copies_says_its_licence() -> None:
    """Kernels, their headers and the example, wherever they end up."""
    repository = ROOT.parent
    licence = tomllib.loads((repository / "pyproject.toml").read_text())["project"]["license"]
    files = [path for path in (repository / "kernels_cl").rglob("*") if path.is_file()]
    files.append(repository / "docs" / "examples" / "host.c")
    assert len(files) > 50
    for path in files:
        first = path.read_text().splitlines()[0]
        assert first == f"// SPDX-License-Identifier: {licence}", path
