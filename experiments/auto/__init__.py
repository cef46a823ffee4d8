"""Method auto: how it decides, what that is worth, and how well it foretells."""

from __future__ import annotations

from pathlib import Path

from experiments import plots
from experiments.auto import criterion, parsimony, predictions
from experiments.results import Parts

NAME = "auto"
QUESTION = "Does method auto find the smallest model that is good enough, and by what signs?"
MINUTES = 13


def run(quick: bool) -> Parts:
    """What it reaches and takes, how good criteria without a reference are, its predictions."""
    return parsimony.run(quick) | criterion.run(quick) | predictions.run(quick)


def charts(parts: Parts, folder: Path) -> None:
    """auto.png: the rank correlation of criteria with the true error, and what each picks."""
    rank, picked = (parts[part][-1] for part in (criterion.RANK, criterion.PICK))
    with plots.figure(folder / f"{NAME}.png", columns=2) as (left, right):
        for name, style in zip((*criterion.CRITERIA, "ours"), plots.MARKS, strict=False):
            found = [rank.get(f"{name}, {side}") for side in criterion.SIDES[:3]]
            left.plot(criterion.SIDES[:3], found, style + "-", label=name)
        left.set_xscale("log", base=2)
        left.set(xlabel="side of the squares, pixels", ylabel="rank correlation", ylim=(0.3, 1))
        left.legend(fontsize=8, loc="lower right")
        names = ("oracle", *criterion.CRITERIA)
        right.bar(names, [picked[name] for name in names])
        right.axhline(1, color="grey", linewidth=1)
        right.set(ylabel="squared error, best fixed candidate = 1")
        right.tick_params(axis="x", rotation=20)
