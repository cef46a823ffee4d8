"""Light: the furnace, Mitsuba's own path tracer, and noisy layers against their reference."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from experiments.rendering.camera import looking
from experiments.rendering.reference import Accumulator, Goal
from experiments.rendering.tracer import Tracer, _primary_ray

Z = 4.5  # standard errors that a mean over a picture may be off


@pytest.fixture(scope="module")
def furnace() -> Tracer:
    """A black ball of radius 0.5 inside a white, glowing sphere of radius 2 and radiance 3."""
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.6}}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "ball": {"type": "sphere", "radius": 0.5, "bsdf": black},
            "shell": {
                "type": "sphere",
                "radius": 2.0,
                "flip_normals": True,
                "bsdf": {"type": "twosided", "nested": grey},
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 3.0}},
            },
        }
    )
    return Tracer.of(scene, looking([0, 0.2, 1.6], [0, 0, 0], 20.0), 16, 9)


@pytest.mark.parametrize("mis", [True, False])
@pytest.mark.parametrize("bounces", [1, 2])
def test_furnace(furnace: Tracer, bounces: int, mis: bool) -> None:
    """A point of the shell sees the ball under the form factor (r / R)^2; the ball sees no ball."""
    seen = 0.6 * (1 - (0.5 / 2.0) ** 2)
    expected = 3.0 * sum(seen**b for b in range(1, bounces + 1))
    assert furnace.guides["mask"].all()
    mean = furnace.indirect(1024, 1, None, bounces, mis) / 1024
    assert np.abs(mean.mean() / expected - 1) < 0.005
    guide = furnace.guide()
    furnace.indirect(64, 2, 0, bounces, mis, guide, True)
    guide.learn()
    guided = furnace.indirect(1024, 3, 0, bounces, mis, guide) / 1024
    assert np.abs(guided.mean() / expected - 1) < 0.005


def test_furnace_direct_and_occlusion(furnace: Tracer) -> None:
    direct = furnace.direct(256, 1) / 256
    assert abs(direct.mean() / 3.0 - 1) < 0.005
    assert (furnace.occlusion(64, 1.0, 1) == 1).all()
    assert (furnace.occlusion(64, 5.0, 1) == 0).all()


def _blocks(picture: Any) -> np.ndarray:
    """Sums over 4 x 4 pixels, so that few samples are near enough to normal."""
    h, w = picture.shape
    return picture.reshape(h // 4, 4, w // 4, 4).sum((1, 3))


def test_1_spp_renders_average_to_the_reference(tracer: Tracer, room: Any) -> None:
    """Many independent noisy layers, within the two standard errors of their mean and of it."""
    from experiments.rendering.frame import Settings

    count = 128
    noisy = np.stack([_blocks(tracer.indirect(1, 100 + i).mean(-1)) for i in range(count)])
    mask = tracer.guides["mask"][..., 0] > 0
    settings = Settings(64, 36, goal=Goal(0.0, 1024, 1024))
    reference = Accumulator.of(tracer, settings, 7, mask)
    reference.run(settings.goal)
    assert reference.spp == 1024
    replicates = np.stack([_blocks(s.mean(-1)) for s in reference.sums]) / 256
    error = np.sqrt(noisy.var(0, ddof=1) / count + replicates.var(0, ddof=1) / 4)
    off = (noisy.mean(0) - replicates.mean(0)) / np.maximum(error, 1e-12)
    # Blocks are sums of few bright paths: their own errors are skewed, their mean is not.
    assert np.mean(np.abs(off) < 3) > 0.95
    total = noisy.sum((1, 2))
    spread = np.hypot(total.std(ddof=1) / count**0.5, replicates.sum((1, 2)).std(ddof=1) / 2)
    assert abs(total.mean() - replicates.sum((1, 2)).mean()) < Z * spread


def test_albedo_times_demodulated_is_what_mitsuba_traces(tracer: Tracer, room: Any) -> None:
    """`path` of depth 3 less depth 2 is one bounce; depth 2 less emission is direct light."""
    count, spp = 8, 32
    indirect, direct = np.zeros((2, count, 36, 64))
    for i in range(count):
        two, three = (_mitsuba(room, depth, 2 * i + depth, spp) for depth in (2, 3))
        indirect[i], direct[i] = three - _mitsuba(room, 2, 900 + i, spp), two
    albedo = tracer.guides["albedo"]
    ours = (albedo * tracer.indirect(512, 5, 0) / 512).mean(-1)
    for theirs, mine in (
        (indirect, ours),
        (direct, (albedo * tracer.direct(512, 6) / 512 + tracer.guides["emission"]).mean(-1)),
    ):
        mask = tracer.guides["mask"][..., 0] > 0
        total = (theirs * mask).sum((1, 2))
        error = total.std(ddof=1) / count**0.5 + 0.002 * total.mean()
        assert abs(total.mean() - (mine * mask).sum()) < Z * error


def _mitsuba(room: Any, depth: int, seed: int, spp: int) -> np.ndarray:
    """Mean luminance (36, 64) of Mitsuba's path tracer along our primary rays."""
    integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 99})
    sampler = mi.load_dict({"type": "independent"})
    lane = dr.arange(mi.UInt32, 64 * 36 * spp) // spp
    sampler.seed(seed, 64 * 36 * spp)
    ray = mi.RayDifferential3f(_primary_ray(room.own[0], 64, 36, lane))
    colour = integrator.sample(room.scene, sampler, ray)[0]
    return np.array(colour).mean(0).reshape(36, 64, spp).mean(-1)
