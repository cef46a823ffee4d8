"""The experiments by name."""

from __future__ import annotations

import importlib

from experiments.results import Experiment

NAMES = (
    "methods",
    "settings",
    "spp",
    "network",
    "block",
    "upsample",
    "guides",
    "lightgroups",
    "ablation",
    "regularisation",
    "tune",
    "speed",
    "large",
    "stability",
    "error_map",
    "auto",
    "training",
    "accumulated",
    "sequences",
    "bmfr",
    "whole",
    "materials",
    "first_picture",
    "threads",
)


def experiment(name: str) -> Experiment:
    """A module of this folder, or an entry of `sweeps.TABLE`."""
    from experiments import sweeps

    if name not in NAMES:
        raise ValueError(f"{name!r} is none of the experiments: {', '.join(NAMES)}")
    return sweeps.TABLE.get(name) or importlib.import_module(f"experiments.{name}")
