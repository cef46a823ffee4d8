"""The scalar variant, where there is neither LLVM nor a GPU: slow, and the same picture."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from experiments.rendering.reference import Accumulator, Goal
from experiments.rendering.scene import build
from experiments.rendering.scenes.catalogue import world_of
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera

SIZE = 16, 9


@pytest.fixture
def scalar() -> Iterator[None]:
    variant = mi.variant()
    mi.set_variant("scalar_rgb")
    yield
    mi.set_variant(variant)


@pytest.fixture
def fast(room: Any) -> tuple[Camera, dict[str, np.ndarray], np.ndarray]:
    """The room's view in the fast variant: camera, guides, and 8 renders of 64 spp."""
    tracer = Tracer.of(room.scene, room.own[0], *SIZE)
    renders = np.stack([tracer.indirect(64, seed) / 64 for seed in range(8)])
    return room.own[0], tracer.guides, renders


def test_it_agrees(fast: Any, scalar: None) -> None:
    from experiments.rendering.frame import Settings

    camera, guides, renders = fast
    tracer = Tracer.of(build(world_of("room")), camera, *SIZE)
    for name, picture in guides.items():
        np.testing.assert_allclose(tracer.guides[name], picture, atol=2e-4, err_msg=name)
    mask = guides["mask"][..., 0] > 0
    reference = Accumulator.of(tracer, Settings(*SIZE), 5, mask)
    reference.run(Goal(0.0, 64, 64))
    totals = (renders * mask[..., None]).mean((1, 2, 3))
    error = totals.std(ddof=1) * np.sqrt(1 + 1 / len(totals))
    assert abs(reference.mean().mean() - totals.mean()) < 4 * error
