"""Time against the number of guides and against pixels: Figure 4 of BMFR."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments import plots, results
from experiments.peers import guided
from experiments.speed import interleaved, synthetic
from jflnr.regression.parameters import DEFAULT
from jflnr.regression.flr import flr
from jflnr.temporal import bmfr_fit

NAME = "complexity"
QUESTION = "How does time grow with the number of guides and with pixels, ours and BMFR's?"
MINUTES = 4

LABELS = {"flr": "FLR, block 8", "bmfr": "BMFR, 32 x 32", "guided": "guided filter, radius 24"}


def run(quick: bool) -> dict[str, Any]:
    """Milliseconds of FLR, BMFR's QR and the guided filter, all compiled by JAX."""
    counts = (2, 5) if quick else (1, 3, 5, 9, 14)
    sizes = (0.05,) if quick else (0.23, 0.92, 3.69)
    base = 0.05 if quick else 0.92
    return {
        "megapixels": base,
        "guides": [row for q in counts for row in measured(base, q, quick)],
        "pixels": [row for size in sizes for row in measured(size, 5, quick)],
    }


def measured(megapixels: float, guides: int, quick: bool) -> list[dict[str, Any]]:
    """Best time of each method on random images of one size."""
    y, x = synthetic(megapixels, guides, 3)
    weight = jnp.ones_like(y[..., :1])
    calls: dict[str, Callable[[], Any]] = {
        "flr": lambda: _flr(y, x, DEFAULT).block_until_ready(),
        "bmfr": lambda: _bmfr(y, x).block_until_ready(),
        "guided": lambda: _guided(y, x, weight).block_until_ready(),
    }
    seconds = interleaved(calls, 1 if quick else 4)
    return [
        {
            "method": name,
            "guides": guides,
            "megapixels": y.shape[0] * y.shape[1] / 1e6,
            "ms": 1e3 * t,
        }
        for name, t in seconds.items()
    ]


_flr = jax.jit(flr)


@jax.jit
def _bmfr(y: jax.Array, x: jax.Array) -> jax.Array:
    surface = jnp.ones_like(y[..., :1], bool)
    return bmfr_fit.fit(y, x, surface, 0, jnp.zeros(2, int))


@jax.jit
def _guided(y: jax.Array, x: jax.Array, weight: jax.Array) -> jax.Array:
    slopes, offset = guided.models(x, y, weight, 24, 0.01)
    return guided.evaluate(slopes, offset, x)


def draw(result: dict[str, Any], folder: Path) -> None:
    """complexity.png and complexity.md."""
    columns = {"method": "method", "guides": "guides", "megapixels": "megapixels", "ms": "ms"}
    plots.write_text(
        folder / f"{NAME}.md", results.table(result["guides"] + result["pixels"], columns)
    )
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        for (name, label), style in zip(LABELS.items(), ("o-", "s--", "^:"), strict=True):
            for axis, rows, key in ((left, "guides", "guides"), (right, "pixels", "megapixels")):
                mine = [row for row in result[rows] if row["method"] == name]
                x, y = np.array([(row[key], row["ms"]) for row in mine]).T
                axis.plot(x, y, style, label=label)
        left.set(xlabel=f"guides, at {result['megapixels']} megapixels", ylabel="milliseconds")
        right.set(xlabel="megapixels, with 5 guides", ylabel="milliseconds", xscale="log")
        sizes = sorted({round(row["megapixels"], 2) for row in result["pixels"]})
        right.set_xticks(sizes, [f"{size:g}" for size in sizes])
        right.minorticks_off()
        left.set_yscale("log")
        right.set_yscale("log")
        left.legend(fontsize=8)
