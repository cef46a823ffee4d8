"""Derivatives of the public functions that no other file here checks (docs/stability.md)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import random

from experiments.peers import paper_network as paper
from jflnr.bmfr import fit as bmfr_fit
from jflnr.bmfr import pipeline as bmfr
from jflnr.bmfr import taa as bmfr_taa
from jflnr.frame import Frame, composite
from jflnr.images.noisy_guides import smooth_guide
from jflnr.network import flnr as networks
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from jflnr.regression.elimination import cholesky_solve
from jflnr.regression.flr import FLR
from jflnr.regression.moments import collect, collect_weighted, plane_count
from jflnr.regression.resampling import double, halve
from jflnr.regression.solve import solve, solve_strips
from jflnr.regression.window import gather_moments, window_over
from jflnr.temporal import (
    Average,
    Camera,
    Surface,
    accumulate,
    camera_motion,
    find_taps,
    gather,
    sequence,
)
from tests.gradients.directions import agree

SIZE = 6, 7
SHIFT = np.array([0.1, -0.2])
# Differences are taken of the logarithms, which are of order 1.
LOGARITHMS = np.log([5.0, 1e-2, 1e-2])
LOG_ADAPTIVE = jax.tree.map(jnp.log, AdaptiveFLR())
RNG = np.random.default_rng(2)


def normal(*shape):
    return RNG.standard_normal(shape)


def positive(*shape):
    return 0.3 + RNG.random(shape)


def moments_of(guides, channels, *grid):
    """Moments that belong to pixels: `(K, h, w)`."""
    y, x = normal(8 * grid[0], 8 * grid[1], channels), normal(8 * grid[0], 8 * grid[1], guides)
    with jax.enable_x64(True):
        return np.asarray(collect(jnp.asarray(y), jnp.asarray(x), jnp.zeros(guides), 8))


def well_posed(count):
    factor = normal(count, count)
    return (factor @ factor.T / count + np.eye(count))[..., None, None]


STEPS = {
    "moments by weights": (
        lambda y, x, w, b: collect(y, x, jnp.asarray(SHIFT), 2, w, b),
        (normal(*SIZE, 2), normal(*SIZE, 2), positive(*SIZE), positive(2)),
    ),
    "weighted moments": (
        lambda y, x, w, s: collect_weighted(y, x, jnp.asarray(SHIFT), w, s, 2),
        (normal(*SIZE, 2), normal(*SIZE, 2), positive(*SIZE), positive(*SIZE)),
    ),
    "edge-aware window": (
        lambda f, sigma, m: gather_moments(m, window_over(f, sigma), 1.3, 2, 1),
        (normal(2, 4, 5), 1.5, normal(plane_count(2, 1), 4, 5)),
    ),
    "resampling": (lambda p: double(halve(p), 5, 7), (normal(2, 5, 7),)),
    "strips": (
        lambda m, e, p: solve_strips(m, jnp.asarray(SHIFT), e, p, 2),
        (moments_of(2, 2, 2, 3), positive(2, 3), positive(2, 3)),
    ),
    "solve, 16 guides": (cholesky_solve, (well_posed(16), normal(16, 2, 1, 1))),
    "normalised solve, 16 guides": (
        lambda m, p: solve(m, jnp.full(16, 0.1), FLR(*jnp.exp(p)), 1),
        (moments_of(16, 1, 1, 1), LOGARITHMS),
    ),
    "smoothing of a guide": (
        smooth_guide,
        (positive(*SIZE, 1), normal(*SIZE, 3) / 9, 5 + positive(*SIZE, 1) / 9),
    ),
    "FLNR of the paper": (
        lambda y, x, w, p: paper.flnr_of_paper(y, x, w, FLR(*jnp.exp(p), block=2, support=12)),
        (
            positive(*SIZE, 2),
            normal(*SIZE, 2),
            paper.init(random.key(0), 4, 2, (3, 4)),
            LOGARITHMS,
        ),
    ),
    "composite": (
        lambda a, light: composite(frame_of(albedo=a), light),
        (positive(*SIZE, 3), positive(*SIZE, 3)),
    ),
    "accumulation": (
        lambda before, n, image, least: accumulate(Average(before, n), image, least),
        (normal(*SIZE, 2), 1 + positive(*SIZE, 1), normal(*SIZE, 2), 0.4),
    ),
    "reprojection by motion and image": (
        lambda motion, image: gather(find_taps(motion, wall(), wall()), image),
        # Between pixels: where a tap becomes another, the derivative jumps.
        (0.2 + 0.6 * RNG.random((*SIZE, 2)), normal(*SIZE, 2)),
    ),
    "motion by depth and camera": (
        lambda d, turn, fov: camera_motion(
            d, Camera(jnp.eye(4), fov), Camera(jnp.eye(4).at[:3].add(turn / 20), fov)
        ),
        (3 + positive(*SIZE, 1), normal(3, 4), 50.0),
    ),
    "BMFR's fit": (
        lambda y, x: bmfr_fit.fit(y, x, jnp.ones((*SIZE, 1), bool), 3, jnp.array([1, 2]), block=4),
        (normal(*SIZE, 2), normal(*SIZE, 2)),
    ),
    "BMFR's TAA": (
        lambda new, old, motion: bmfr_taa.smooth(
            new, old, jnp.ones((*SIZE, 1), bool), motion / 5, 0.2
        ),
        (positive(*SIZE, 3), positive(*SIZE, 3), normal(*SIZE, 2)),
    ),
}


def wall():
    return Surface(jnp.ones((*SIZE, 3)) / 3**0.5, jnp.ones((*SIZE, 1)))


def frame_of(**layers):
    """A frame of `SIZE` with the given layers and made-up others."""
    rng = np.random.default_rng(4)
    others = {
        "indirect": 0.3 + rng.random((*SIZE, 3)),
        "albedo": 0.3 + rng.random((*SIZE, 3)),
        "normal": [0, 0, 1] + rng.standard_normal((*SIZE, 3)) / 9,
        "depth": 2 + rng.random((*SIZE, 1)),
        "ao": rng.random((*SIZE, 1)),
        "motion": np.zeros((*SIZE, 2)),
    }
    return Frame(**(jax.tree.map(jnp.asarray, others) | layers))


@pytest.mark.parametrize("name", STEPS)
def test_step(name):
    agree(STEPS[name][0], *STEPS[name][1])


def next_of_shot(step, start, *options):
    """The second frame of a shot by the light of both."""

    def both(first, second):
        frames = frame_of(indirect=first), frame_of(indirect=second)
        state, _ = step(start(frames[0]), frames[0], *options)
        return step(state, frames[1], *options)[1]

    return both


def exp(method):
    return jax.tree.map(jnp.exp, method)


LIGHT = positive(*SIZE, 3)
FRAMES = LIGHT, 1.1 * LIGHT + 0.1 * positive(*SIZE, 3)
WHOLE = {
    "adaptive FLR and its error": (
        lambda y, x, p: flr_adaptive(y, x, exp(p), with_error=True),
        (positive(40, 48, 3), normal(40, 48, 2), LOG_ADAPTIVE),
    ),
    "FLNR": (
        lambda y, normal, near, w: networks.flnr(y, (normal, near), params=w),
        (
            positive(40, 48, 3),
            normal(40, 48, 3) / 9,
            positive(40, 48, 2) / 9,
            networks.init(random.key(0), (4, 4)),
        ),
    ),
    "shots": (next_of_shot(sequence.step, sequence.start, "flr"), FRAMES),
    "BMFR": (next_of_shot(bmfr.step, bmfr.start), FRAMES),
}


@pytest.mark.slow  # compiles long
@pytest.mark.parametrize("name", WHOLE)
def test_whole(name):
    # Maxima have corners: a step must not reach the next one.
    agree(*WHOLE[name][:1], *WHOLE[name][1], step=1e-6, forward_tolerance=1e-5)
