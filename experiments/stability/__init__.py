"""Where methods of local regression fail: each solver on each hard case, in each precision."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from experiments.results import Parts
from experiments.stability import drawing, fireflies
from experiments.stability.cases import CASES, Type, make
from experiments.stability.measures import measure, passes
from experiments.stability.methods import EXACT, METHODS, ON_DEVICE, OURS, TRUTHS, Method, exists

NAME = "stability"
QUESTION = "On which inputs does which solver fail, and does ours on any?"
MINUTES = 5

SIZE = 36, 44  # pixels; blocks hang over both borders
# Storage of the frame, and the arithmetic on it.
PRECISIONS: dict[str, tuple[Type, Type]] = {
    "float64": (np.float64, np.float64),
    "float32": (np.float32, np.float32),
    "float16": (np.float16, np.float32),
    "bfloat16": (jnp.bfloat16, np.float32),
}


def run(quick: bool) -> Parts:
    """One row per case, precision and method: the figures of `measures.measure`."""
    precisions = ["float32"] if quick else list(PRECISIONS)
    skipped = {"ours, block inverse"} if quick else set()
    methods = {name: m for name, m in METHODS.items() if name not in skipped}
    if not _opencl_works():
        print("  no OpenCL device: those cells stay empty", flush=True)
        methods = {name: m for name, m in methods.items() if name not in ON_DEVICE}
    rows = []
    for case in CASES:
        for precision in precisions:
            rows += cells(case, precision, methods)
        bad = [f"{r['method']} {r['precision']}" for r in rows if r["case"] == case and misses(r)]
        print(f"  {case}: {'ours misses the bar: ' + ', '.join(bad) if bad else 'ok'}", flush=True)
    return {
        "cells that clear the bar": drawing.counts(rows),
        "robust fits, made up": fireflies.run(quick),
        "robust fits, real frames": fireflies.real(quick),
        "cells": rows,
    }


def cells(name: str, precision: str, methods: dict[str, Method]) -> list[dict[str, Any]]:
    """The figures of all methods on one case."""
    storage, arithmetic = PRECISIONS[precision]
    case = make(name, *SIZE, storage)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)
        exact = EXACT(case, np.float64)
        rows = []
        for method, solve in methods.items():
            if not exists(method, case, arithmetic):
                continue
            truth = TRUTHS[method](case, np.float64) if method in TRUTHS else exact
            figures = measure(case, solve(case, arithmetic), truth, exact)
            rows.append({"case": name, "precision": precision, "method": method, **figures})
    return rows


def misses(row: dict[str, Any]) -> bool:
    """Whether this cell is one of ours and does not clear the bar."""
    return row["method"] in OURS and not passes(row)


def _opencl_works() -> bool:
    from jflnr.opencl import NoDevice
    from jflnr.opencl.context import default_context

    try:
        default_context()
    except (NoDevice, ImportError):
        return False
    return True


def charts(parts: Parts, folder: Path) -> None:
    """The heat map."""
    drawing.heat_map(parts["cells"], folder / f"{NAME}.png")
