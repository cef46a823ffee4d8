"""Training the network: optimisers, how much to learn from, one's own frames, the paper's form."""

from __future__ import annotations

from experiments.results import Parts
from experiments.training import finetune, learning_curve, optimisers, paper_form

NAME = "training"
QUESTION = "What trains the network best, what do more scenes and own frames bring it?"
MINUTES = 70


def run(quick: bool) -> Parts:
    """The four of them, one after the other."""
    parts = [part.run(quick) for part in (learning_curve, optimisers, finetune, paper_form)]
    return {title: rows for part in parts for title, rows in part.items()}
