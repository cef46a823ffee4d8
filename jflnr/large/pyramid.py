"""Adaptive FLR piece by piece: passes over strips of pixels, and between them over tiles of blocks.

Its windows reach 800 pixels, too far for strips that overlap; but what they look at are moments, of
which there are few. So strips that do not overlap are read three times, as `flr_adaptive` passes
over its pixels three times. Moments and models wait in files, and what happens on blocks is done
tile by tile. What concerns the whole frame, its mean brightness and how much of it the models keep,
is summed up on the way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.flr import adaptive, energy
from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.moments import centre, index_xy, magnitude, plane_count
from jflnr.large import steps
from jflnr.large.local import Strip
from jflnr.large.pieces import Piece, pieces
from jflnr.large.planes import Planes
from jflnr.large.source import Rows, read_with_neighbours, scene_of, sparse
from jflnr.large.steps import Common

# How far a model looks, in finest blocks. On each of four levels: 5 blocks of its window over fits
# that follow the coarser level, 5 of the coarser window, and the interpolation between the two.
REACH = 208
# Blocks on a side of one of the coarsest grid; blocks that the window of the pilot reaches.
COARSEST = 2 ** (adaptive.LEVELS - 1)
PILOT_REACH = 12


@dataclass(frozen=True)
class Job:
    """A frame to denoise, and in what pieces: strips of `height` rows, tiles of `tile` pixels.

    names: of the guides. block: side of the finest blocks, in pixels. folder: for temporary files.
    """

    rows: Rows
    common: Common
    names: tuple[str, ...]
    block: int
    height: int
    tile: int
    folder: Path | None

    def planes(self, count: int, side: int) -> Planes:
        """A file for planes on blocks of `side` pixels."""
        size = -(-self.rows.height // side), -(-self.rows.width // side)
        return Planes(self.folder, count, *size)

    def strips(self) -> list[Piece]:
        return pieces(self.rows.height, self.height, 0, 4 * self.block)

    def tiles(self, side: int, reach: int, align: int) -> list[tuple[Piece, Piece]]:
        """Rows and columns of tiles, in blocks of `side` pixels."""
        rows, columns = (
            pieces(-(-size // side), max(self.tile // side, 1), reach, align)
            for size in (self.rows.height, self.rows.width)
        )
        return list(itertools.product(rows, columns))


# Of a job, its moments and models, the brightness that these give blocks twice as large, the mean
# brightness, and how much brightness is given back.
Network = Callable[[Job, Planes, Planes, np.ndarray, jax.Array, jax.Array], None]


def strips(
    rows: Rows,
    names: tuple[str, ...],
    parameters: AdaptiveParameters,
    *,
    block: int,
    tile: int,
    keep_energy: bool = False,
    folder: Path | None = None,
    network: Network | None = None,
) -> Iterator[Strip]:
    """The frame in strips from top to bottom; arguments as of `flr_adaptive`.

    names: of the guides. tile: side in pixels of a square as large as what is worked on at a time.
    folder: for temporary files. network: puts other models in the place of those fitted.
    """
    scene = scene_of(rows)
    layers, target = sparse(rows, lambda frame: steps.images_of(frame, names, scene))
    common = Common(scene, centre(layers), magnitude(target), parameters.numbers())
    # Strips do not overlap, so small ones cost nothing.
    finest, height = max(block // 2, 1), max(tile * tile // (4 * rows.width), 1)
    job = Job(rows, common, names, finest, height, tile, folder)
    guides = common.shift.size
    with ExitStack() as files:
        light = files.enter_context(job.planes(plane_count(guides, 1), 2 * finest))
        moments = files.enter_context(job.planes(plane_count(guides, rows.channels) + 1, finest))
        models = files.enter_context(job.planes((guides + 2) * rows.channels, finest))
        count, wanted = _collect_light(job, light)
        mean = jnp.float32(wanted / count if wanted > 0 else 1)
        _collect_moments(job, _pilot(job, light, mean), mean, moments)
        output, before, squares = _fit(job, light, moments, models, mean)
        sums = [jnp.float32(total) for total in (wanted, before, squares)]
        rate = energy.rate(sums[0], sums[1], sums[2], common.numbers.slack)
        if network is not None:
            network(job, moments, models, output, mean, rate)
            rate = jnp.float32(0)
        share = 1.0
        if keep_energy:
            share = _kept_share(rows, _apply(job, models, output, rate))
        for start, image in _apply(job, models, output, rate):
            yield start, image * np.float32(share)


def _collect_light(job: Job, light: Planes) -> tuple[float, float]:
    """Pass 1; how many usable pixels there are and their brightness, as sums over blocks."""
    count = wanted = 0.0
    for piece in job.strips():
        strip = read_with_neighbours(job.rows, piece.low, piece.high)
        found = np.asarray(steps.light_of_strip(strip, job.common, job.names, job.block))
        blocks = piece.on(2 * job.block)
        found = found[:, blocks.kept]
        light[blocks.inner, :] = found
        count += float(found[0].sum(dtype=np.float64))
        total = found[index_xy(0, 0, job.common.shift.size, 1)]
        wanted += float(total.sum(dtype=np.float64))
    return count, wanted


def _pilot(job: Job, light: Planes, mean: jax.Array) -> np.ndarray:
    """Models of the brightness, `(Q + 1, 1, h + 2, w)` with the borders repeated."""
    size = -(-light.height // 2), -(-light.width // 2)
    models = np.empty((job.common.shift.size + 1, 1, *size), np.float32)
    for across, along in job.tiles(2 * job.block, PILOT_REACH, 2):
        found = steps.pilot_of_tile(light[across.outer, along.outer], mean, job.common, job.block)
        y, x = across.on(2), along.on(2)
        models[:, :, y.inner, x.inner] = np.asarray(found)[:, :, y.kept, x.kept]
    return np.pad(models, ((0, 0), (0, 0), (1, 1), (0, 0)), mode="edge")


def _collect_moments(job: Job, pilot: np.ndarray, mean: jax.Array, moments: Planes) -> None:
    """Pass 2."""
    for piece in job.strips():
        rows = piece.on(4 * job.block)
        part = adaptive.Pilot(jnp.asarray(pilot[:, :, rows.low : rows.high + 2]), mean)
        strip = read_with_neighbours(job.rows, piece.low, piece.high)
        found = np.asarray(steps.moments_of_strip(strip, part, job.common, job.names, job.block))
        blocks = piece.on(job.block)
        moments[blocks.inner, :] = found[:, blocks.kept]


def _fit(
    job: Job, light: Planes, moments: Planes, models: Planes, mean: jax.Array
) -> tuple[np.ndarray, float, float]:
    """The models, tile by tile.

    Returns the brightness that they give blocks `(h, w)` of `light`, and the sums over the frame of
    that and of its square.
    """
    output = np.empty((light.height, light.width), np.float32)
    before = squares = 0.0
    for across, along in job.tiles(job.block, REACH, COARSEST):
        y, x = across.on(2), along.on(2)
        beside = light[y.outer, x.outer]
        tile = moments[across.outer, along.outer]
        found, given = map(
            np.asarray,
            steps.models_of_tile(tile, beside, mean, job.common, job.rows.channels, job.block),
        )
        found = found.reshape(-1, *found.shape[2:])
        models[across.inner, along.inner] = found[:, across.kept, along.kept]
        output[y.inner, x.inner] = given = given[y.kept, x.kept]
        count = beside[0, y.kept, x.kept].astype(np.float64)
        before += float((count * given).sum())
        squares += float((count * given**2).sum())
    return output, before, squares


def _apply(job: Job, models: Planes, output: np.ndarray, rate: jax.Array) -> Iterator[Strip]:
    """Pass 3."""
    for piece in job.strips():
        blocks = piece.on(job.block)
        low, high = max(blocks.low - 2, 0), min(blocks.high + 2, models.height)
        part = models[low:high, :].reshape(-1, job.rows.channels, high - low, models.width)
        given = jnp.asarray(output[low // 2 : -(-high // 2)])
        part = np.asarray(energy.scale(jnp.asarray(part), given, rate))
        # One more row of blocks on both sides, repeated at the frame's borders.
        part = np.pad(part, ((0, 0), (0, 0), (1, 1), (0, 0)), mode="edge")
        part = part[:, :, blocks.low - low :][:, :, : blocks.high - blocks.low + 2]
        strip = read_with_neighbours(job.rows, piece.low, piece.high)
        image = steps.image_of_strip(strip, part, job.common, job.names, job.block)
        yield piece.start, np.asarray(image)[piece.kept]


def _kept_share(rows: Rows, images: Iterator[Strip]) -> float:
    """What brings the brightness of the result to the input's, as `energy.rescale` does."""
    before = after = 0.0
    for start, image in images:
        frame = rows.read(start, start + image.shape[0])
        light = np.asarray(adaptive.light_of(jnp.asarray(frame.indirect)))
        given = np.asarray(adaptive.light_of(jnp.asarray(image)))
        counts = np.isfinite(light)
        if frame.mask is not None:
            counts &= frame.mask[..., 0] > 0
        before += float(light[counts].sum(dtype=np.float64))
        after += float(given[counts].sum(dtype=np.float64))
    return before / after if after > 0 else 1.0
