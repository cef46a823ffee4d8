"""Scenes for the renderer's tests, and the start of Mitsuba where it is installed."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import pytest

HAS_MITSUBA = importlib.util.find_spec("mitsuba") is not None

if HAS_MITSUBA:
    from experiments.rendering import backend

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        VARIANT = backend.start()
else:
    VARIANT = ""

FAST = VARIANT.startswith(("llvm", "cuda"))


def pytest_ignore_collect(collection_path: Any) -> bool | None:
    """Modules that use Mitsuba's types cannot even be imported without it."""
    return None if FAST or collection_path.name in ("conftest.py", "test_without.py") else True


@pytest.fixture(scope="session")
def room() -> Any:
    """The room that ships, loaded: a Source."""
    from experiments.rendering.source import load

    return load("room")


@pytest.fixture(scope="session")
def tracer(room: Any) -> Any:
    """The room's own view at 64 x 36."""
    from experiments.rendering.tracer import Tracer

    return Tracer.of(room.scene, room.own[0], 64, 36)
