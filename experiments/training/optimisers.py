"""The optimisers of jaxopt on the network, on equal budgets of processor time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jaxopt
import numpy as np

from experiments import data, resume
from experiments.results import Parts
from experiments.training import shared
from jflnr.network import flnr, loss
from jflnr.network.adam import Adam
from jflnr.network.train import CONFIGS, Settings, rate_of

NAME = "training-optimisers"

SECONDS = 120.0
# Of frames and validation crops.
FRAMES, VALIDATION = 48, 8
# What the loss cannot fall below, as the Polyak step needs it.
LEAST = float(10 * np.log10(loss.FLOOR))

# By name: the solver, and whether its steps take a few examples or all of them.
SOLVERS: dict[str, tuple[Callable[[], Any], bool]] = {
    "Adam (ours)": (lambda: Adam(shared.objective, rate_of(Settings())), True),
    "ArmijoSGD": (lambda: jaxopt.ArmijoSGD(shared.objective), True),
    "PolyakSGD": (
        lambda: jaxopt.PolyakSGD(shared.objective, fun_min=LEAST, max_stepsize=0.01), True
    ),
    "PolyakSGD, momentum": (
        lambda: jaxopt.PolyakSGD(
            shared.objective, fun_min=LEAST, max_stepsize=0.01, momentum=0.9
        ),
        True,
    ),
    "L-BFGS, all examples": (
        lambda: jaxopt.LBFGS(shared.objective, linesearch="backtracking", maxls=8), False
    ),
    "nonlinear CG, all examples": (
        lambda: jaxopt.NonlinearCG(shared.objective, linesearch="backtracking", maxls=8), False
    ),
}  # fmt: skip


def run(quick: bool) -> Parts:
    """The lowest validation loss of each solver; the size is that of flnr-tiny."""
    tag, seconds = "-quick" * quick, 0.5 if quick else SECONDS
    paths = shared.frames()
    paths = [data.SHIPPED] if quick or not paths else paths[:: max(len(paths) // FRAMES, 1)]
    known = shared.pool(paths, 1)
    judged = shared.pool(paths if quick else data.frames("val"), 1 if quick else VALIDATION // 4)
    initial = flnr.init(jax.random.key(0), CONFIGS["tiny"])
    evaluate = jax.jit(shared.objective)

    def on_solver(name: str) -> list[dict[str, Any]]:
        make, stochastic = SOLVERS[name]
        batch = shared.BATCH if stochastic else shared.count(known)
        return [
            {"optimiser": name, "after seconds": spent, "after steps": steps}
            | {"lowest validation loss": shared.mean_loss(params, judged, evaluate)}
            for spent, steps, params in shared.descend(make(), initial, known, batch, seconds)
        ]

    names = list(SOLVERS)[:2] if quick else list(SOLVERS)
    found = resume.rows(f"{NAME}{tag}", names, on_solver)
    return {
        "optimisers": [min(rows, key=lambda row: row["lowest validation loss"]) for rows in found]
    }
