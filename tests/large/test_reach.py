"""Nothing beyond a stage's reach has a part in what it gives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.network import unet
from jflnr.network.features import Read
from jflnr.network.flnr import FLNR, init, said
from jflnr.regression.adaptive import AdaptiveFLR, reach_of
from jflnr.regression.auto import Auto
from jflnr.regression.flr import FLR
from jflnr.stages import Stage

# First plane and number of planes of what is read.
PARTS = ((0, 3), (3, 3), (6, 1), (7, 3), (10, 1), (11, 1), (12, 1))


class Run(NamedTuple):
    """A stage and what it is given. sides: of all blocks so far, by name."""

    stage: Stage
    parts: dict[str, Any]
    known: dict[str, Any]
    sides: dict[str, int]


def runs(method: Any, width: int) -> Iterator[Run]:
    """Each stage of a method that reads no pixels, on a low and wide image of noise."""
    rng = np.random.default_rng(0)
    size = 4 * method.block, width
    images = {
        "target": rng.exponential(size=(*size, 3)),
        "guides": np.concatenate([np.zeros((*size, 2)), rng.random((*size, 3))], axis=-1),
    }
    parts = jax.tree.map(jnp.float32, images) | {"guides_map": None, "weight": None}
    known, sides = method.known(parts), dict[str, int]()
    for stage in method.stages():
        if stage.gives[0][1] == 0:
            return
        if not stage.pixels:
            yield Run(stage, {name: parts[name] for name in stage.reads}, known, sides)
        given = jax.jit(stage.run)(method, parts, known)
        if stage.learn is not None:
            sums = {name: given.pop(name).sum((-2, -1)) for name, _ in stage.totals}
            known = known | stage.learn(method, known, sums)
        parts, sides = parts | given, sides | dict(stage.gives)


def talkative(widths: tuple[int, ...]) -> unet.Params:
    """Random weights, also where training starts from zero."""
    params = init(jax.random.key(0), widths)
    keys = jax.random.split(jax.random.key(1), len(params))
    noise = (jax.random.normal(key, params[n].shape) for key, n in zip(keys, params, strict=True))
    return {n: params[n] + 0.3 * more for n, more in zip(params, noise, strict=True)}


@pytest.mark.parametrize(
    ("method", "width"),
    [
        (FLR(sigma=20.0, block=4), 160),
        (FLR(sigma=5.0, block=4, support=14), 160),
        (AdaptiveFLR(block=2), 256),
        (AdaptiveFLR(block=4, levels=2, with_error=True), 256),
        (Auto(block=2, levels=3), 256),
    ],
    ids=["flr", "flr, narrow", "flr-adaptive", "flr-adaptive, error", "auto"],
)
def test_what_is_beyond_the_reach_changes_nothing(method: Any, width: int) -> None:
    found = list(runs(method, width))
    assert found
    for stage, parts, known, sides in found:
        # Where a tile could begin that does not belong to the result.
        align = max(stage.align, *(side for _, side in stage.gives))
        start = (stage.reach // align + 1) * align
        assert start < width - align, "the image is too narrow to tell"
        changed = {
            name: plane.at[..., start // sides[name] :].multiply(3.0)
            for name, plane in parts.items()
        }
        program = jax.jit(stage.run)
        before, after = (program(method, some, known) for some in (parts, changed))
        for name, side in stage.gives:
            kept = (start - stage.reach) // side
            assert kept > 0
            np.testing.assert_array_equal(before[name][..., :kept], after[name][..., :kept])
            assert np.any(before[name] != after[name])


def test_the_network_reaches_as_far_as_it_says() -> None:
    """What differs from there on changes no factor before, wherever a strip may begin."""
    params, side = talkative((4, 4, 4)), 8
    assert FLNR(params=params).stages()[-2].reach == unet.reach_of(3)
    rng = np.random.default_rng(0)
    planes = rng.exponential(size=(13, 16, 160)).astype(np.float32)
    read = Read(*(planes[k : k + n].transpose(1, 2, 0) for k, n in PARTS))
    program, start = jax.jit(said), -(-unet.reach_of(3) // side) * side + side
    other = jax.tree.map(lambda image: image.copy(), read)
    for image in other:
        image[:, start:] *= 3
    before, after = (program(params, some) for some in (read, other))
    kept = start - unet.reach_of(3)
    assert kept > 0
    np.testing.assert_array_equal(before[:, :kept], after[:, :kept])
    assert np.any(before[:, kept:start] != after[:, kept:start])


def test_reaches_are_no_larger_than_they_need_be() -> None:
    """Tiles overlap by them: they are memory."""
    assert reach_of(4) <= 208
    assert max(stage.reach for stage in AdaptiveFLR().stages()) <= 208 * AdaptiveFLR().finest
    assert all(unet.reach_of(scales) <= 6 * 2**scales for scales in range(1, 6))
    # Three standard deviations, in whole blocks.
    assert max(stage.reach for stage in FLR(sigma=8.0).at(1, 1000).stages()) == 24
