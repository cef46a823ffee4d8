"""The optimisers of jaxopt on the network, on equal budgets of processor time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jaxopt
import numpy as np

from experiments import data, plots, results, resume, training
from jflnr.network import loss, regression
from jflnr.network.adam import Adam
from jflnr.network.train import CONFIGS, Settings, rate_of

NAME = "optimisers"
QUESTION = "Which optimiser of jaxopt trains the network best in equal time?"
MINUTES = 20

SECONDS = 120.0
# Of frames and validation crops.
FRAMES, VALIDATION = 48, 8
# What the loss cannot fall below, as the Polyak step needs it.
LEAST = float(10 * np.log10(loss.FLOOR))

# By name: the solver, and whether its steps take a few examples or all of them.
SOLVERS: dict[str, tuple[Callable[[], Any], bool]] = {
    "Adam (ours)": (lambda: Adam(training.objective, rate_of(Settings())), True),
    "ArmijoSGD": (lambda: jaxopt.ArmijoSGD(training.objective), True),
    "PolyakSGD": (
        lambda: jaxopt.PolyakSGD(training.objective, fun_min=LEAST, max_stepsize=0.01), True
    ),
    "PolyakSGD, momentum": (
        lambda: jaxopt.PolyakSGD(
            training.objective, fun_min=LEAST, max_stepsize=0.01, momentum=0.9
        ),
        True,
    ),
    "L-BFGS, all examples": (
        lambda: jaxopt.LBFGS(training.objective, linesearch="backtracking", maxls=8), False
    ),
    "nonlinear CG, all examples": (
        lambda: jaxopt.NonlinearCG(training.objective, linesearch="backtracking", maxls=8), False
    ),
}  # fmt: skip


def run(quick: bool) -> dict[str, Any]:
    """Validation loss against processor time, by solver; the size is that of flnr-tiny."""
    tag, seconds = "-quick" * quick, 0.5 if quick else SECONDS
    paths = training.frames()
    paths = [data.SHIPPED] if quick or not paths else paths[:: max(len(paths) // FRAMES, 1)]
    known = training.pool(paths, 1)
    judged = training.pool(paths if quick else data.frames("val"), 1 if quick else VALIDATION // 4)
    initial = regression.init(jax.random.key(0), CONFIGS["tiny"])
    evaluate = jax.jit(training.objective)

    def on_solver(name: str) -> list[dict[str, Any]]:
        make, stochastic = SOLVERS[name]
        batch = training.BATCH if stochastic else training.count(known)
        return [
            {"solver": name, "seconds": spent, "steps": steps}
            | {"validation": training.mean_loss(params, judged, evaluate)}
            for spent, steps, params in training.descend(make(), initial, known, batch, seconds)
        ]

    names = list(SOLVERS)[:2] if quick else list(SOLVERS)
    rows = [row for rows in resume.rows(f"{NAME}{tag}", names, on_solver) for row in rows]
    return {"examples": training.count(known), "rows": rows}


def draw(result: dict[str, Any], folder: Path) -> None:
    """optimisers.png: the curves; optimisers.md: the best of each."""
    by_solver: dict[str, list[dict[str, Any]]] = {}
    for row in result["rows"]:
        by_solver.setdefault(row["solver"], []).append(row)
    best = [min(rows, key=lambda row: row["validation"]) for rows in by_solver.values()]
    columns = {"solver": "optimiser", "validation": "lowest validation loss"}
    columns |= {"steps": "after steps", "seconds": "after seconds"}
    plots.write_text(folder / f"{NAME}.md", results.table(best, columns))
    with plots.figure(folder / f"{NAME}.png") as axis:
        for name, rows in by_solver.items():
            axis.plot(
                [row["seconds"] for row in rows], [row["validation"] for row in rows], label=name
            )
        axis.set(xlabel="seconds of processor time", ylabel="validation loss")
        axis.legend(fontsize=8)
