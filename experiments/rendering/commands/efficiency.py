"""`render efficiency`: samples a second, and variance x seconds of every way to sample.

Seconds of the variance are those of the processor, so that other programs do not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from experiments.rendering.source import RANDOM, load
from experiments.rendering.tracer import Tracer

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
    titles = ("mean", "rel. error", "M/s", "M/core-s", "var. x s", "gain")
    print(f"{'sampling':34}" + "".join(f"{title:>11}" for title in titles))
    first = 0.0
    for title, sums in _ways(tracer):
        sums(1, 0)  # compiles
        start, used = time.monotonic(), time.process_time()
        a, b = (sums(spp, seed)[mask] / spp for seed in (1, 2))
        seconds, used = time.monotonic() - start, time.process_time() - used
        mean = float((a + b).mean()) / 2
        error = np.median(np.abs(a - b).mean(-1) / np.maximum((a + b).mean(-1), 1e-9)) / 0.6745
        cost = error**2 * used
        first = first or cost
        count = 2 * spp * tracer.width * tracer.height / 1e6
        numbers = (mean, error, count / seconds, count / used, cost, first / cost)
        print(f"{title:34}" + "".join(f"{number:11.4g}" for number in numbers), flush=True)


def _ways(tracer: Tracer) -> list[tuple[str, Sums]]:
    guide = tracer.guide()
    if guide is None:
        raise ValueError("the scalar variant has no guides to compare: it needs libLLVM or a GPU")
    for seed, count in ((90, 16), (91, 32)):
        tracer.indirect(count, seed, 0, guide=guide, learning=True)
        guide.learn()
    return [
        ("independent, NEE + MIS", lambda n, s: tracer.indirect(n, s)),
        ("independent, NEE only", lambda n, s: tracer.indirect(n, s, mis=False)),
        ("(0,2)-sequence, NEE + MIS", lambda n, s: tracer.indirect(n, s, 0)),
        ("(0,2)-sequence, NEE only", lambda n, s: tracer.indirect(n, s, 0, mis=False)),
        ("guided sequence, NEE + MIS", lambda n, s: tracer.indirect(n, s, 0, guide=guide)),
        (
            "guided sequence, NEE only",
            lambda n, s: tracer.indirect(n, s, 0, mis=False, guide=guide),
        ),
    ]
