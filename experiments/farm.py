"""Experiments on a Dask cluster, one experiment per worker at a time."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from pathlib import Path

from experiments import results
from experiments.catalogue import experiment
from jflnr.cluster import each


def run(
    address: str, names: Sequence[str], quick: bool, out: Path
) -> Iterator[tuple[str, BaseException | None]]:
    """Run experiments, each into `out` on the shared file system; name and what went wrong."""
    work = functools.partial(_one, quick, out.resolve())
    return each(address, work, names, lambda name, error: (name, error))


def _one(quick: bool, out: Path, name: str) -> tuple[str, None]:
    results.run(experiment(name), quick, out)
    return name, None
