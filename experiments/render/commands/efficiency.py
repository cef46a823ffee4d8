"""`render efficiency`: samples a second, and variance x seconds of every way to sample."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from experiments.render.source import RANDOM, load
from experiments.render.tracer import Tracer

Sums = Callable[[int, int], NDArray[np.float64]]


def run(arguments: argparse.Namespace) -> None:
    """Print a table for each scene; every row must agree in its mean."""
    for name in arguments.scenes:
        source = load(name)
        view = source.view(0 if 0 in source.own else RANDOM)
        if view is None:
            raise ValueError(f"no valid view of {name} was found")
        _table(name, Tracer.of(source.scene, view[0], 320, 180), arguments.spp)


def _table(name: str, tracer: Tracer, spp: int) -> None:
    mask = tracer.guides["mask"][..., 0] > 0
    print(f"{name}, 320 x 180, {spp} spp, against variance x seconds of the first row")
    print(f"{'sampling':34}{'mean':>10}{'rel. error':>11}{'Msamples/s':>11}{'var. x s':>10}{'gain':>7}")
    first = 0.0
    for title, sums in _ways(tracer):
        sums(1, 0)  # compiles
        start = time.monotonic()
        a, b = (sums(spp, seed)[mask] / spp for seed in (1, 2))
        seconds = time.monotonic() - start
        mean = float((a + b).mean()) / 2
        error = np.median(np.abs(a - b).mean(-1) / np.maximum((a + b).mean(-1), 1e-9)) / 0.6745
        cost = error**2 * seconds
        first = first or cost
        speed = 2 * spp * tracer.width * tracer.height / seconds / 1e6
        print(f"{title:34}{mean:10.5g}{error:11.4f}{speed:11.2f}{cost:10.4f}{first / cost:7.1f}")


def _ways(tracer: Tracer) -> list[tuple[str, Sums]]:
    guide = tracer.guide()
    for seed, count in ((90, 16), (91, 32)):
        tracer.indirect(count, seed, 0, guide=guide, learning=True)
        guide.learn()
    return [
        ("independent, NEE + MIS", lambda n, s: tracer.indirect(n, s)),
        ("independent, NEE only", lambda n, s: tracer.indirect(n, s, mis=False)),
        ("(0,2)-sequence, NEE + MIS", lambda n, s: tracer.indirect(n, s, 0)),
        ("(0,2)-sequence, NEE only", lambda n, s: tracer.indirect(n, s, 0, mis=False)),
        ("guided sequence, NEE + MIS", lambda n, s: tracer.indirect(n, s, 0, guide=guide)),
        ("guided sequence, NEE only", lambda n, s: tracer.indirect(n, s, 0, mis=False, guide=guide)),
    ]
