"""Any method on parts of a frame, stage by stage; what lies between them waits in files.

Stages that read pixels run on strips of whole rows, the others on tiles of blocks. A part is worked
on with as much around it as the stage says that it looks at, so that the result is the whole's.
"""

import functools
import itertools
import math
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jflnr.frame import Frame
from jflnr.images.guides import Scene
from jflnr.large.pieces import Piece, pieces
from jflnr.large.source import Rows, scene_of
from jflnr.stages import Known, Parts, Stage

# The first row of a strip, and what the last stage gives for it: `image` and more, `(h, W, C)`.
Strip = tuple[int, Parts]


class Planes:
    """Planes `(*lead, *size)` of float32 in a temporary file, as much in memory as is being used.

    `file` is gone once it is closed. There the planes of a row lie together, since rows are what is
    written and read. side: of the blocks that they are on, in pixels; 0 for pixels.
    """

    def __init__(
        self, folder: Path | None, lead: tuple[int, ...], size: tuple[int, int], side: int = 0
    ) -> None:
        self.lead, self.side = lead, side
        self.shape = size[0], math.prod(lead), size[1]
        self.file = tempfile.TemporaryFile(dir=folder, prefix=".jflnr-")
        self.file.truncate(4 * math.prod(self.shape))

    def __setitem__(self, area: tuple[slice, slice], planes: np.ndarray) -> None:
        rows, columns = area
        flat = planes.reshape(-1, *planes.shape[-2:])
        self._mapped()[rows, :, columns] = np.moveaxis(flat, 0, 1)

    def __getitem__(self, area: tuple[slice, slice]) -> np.ndarray:
        rows, columns = area
        found = np.ascontiguousarray(np.moveaxis(self._mapped()[rows, :, columns], 1, 0))
        return found.reshape(*self.lead, *found.shape[1:])

    def _mapped(self) -> np.memmap:
        # Mapped anew each time: what was touched counts as this process's memory until unmapped.
        return np.memmap(self.file, np.float32, "r+", shape=self.shape)


@dataclass
class Job:
    """A frame to denoise, in strips and tiles of about `tile` x `tile` pixels.

    names: of the guides. folder: for temporary files, the system's own if None. known: of the whole
    frame. kept: by name, what earlier stages gave.
    """

    rows: Rows
    method: Any
    names: tuple[str, ...]
    scene: Scene
    tile: int
    folder: Path | None
    files: ExitStack
    known: Known = field(default_factory=dict)
    kept: dict[str, Planes] = field(default_factory=dict)

    def places(self, stage: Stage) -> list[tuple[Piece, Piece]]:
        """Rows and columns of the parts that a stage is run on, in pixels."""
        height, width, tile = self.rows.height, self.rows.width, self.tile
        sides = [side for _, side in (*stage.gives, *stage.totals)]
        sides += [self.kept[name].side for name in stage.reads]
        align = math.lcm(stage.align, self.rows.factor, *filter(None, sides))
        if 0 not in sides and not stage.pixels:
            down, across = (pieces(n, tile, stage.reach, align) for n in (height, width))
            return list(itertools.product(down, across))
        strip, reach = max(tile * tile // width, 1), stage.reach + self.method.margin
        return [(rows, Piece(0, width, 0, width)) for rows in pieces(height, strip, reach, align)]

    def run(self, stage: Stage, rows: Piece, columns: Piece) -> Parts:
        """What a stage gives for one part with all around it."""
        parts = {name: self._read(self.kept[name], rows, columns) for name in stage.reads}
        frame = self.rows.read(rows.low, rows.high) if stage.pixels else None
        return _run(stage, self.method, frame, self.names, self.scene, parts, self.known)

    def _read(self, kept: Planes, rows: Piece, columns: Piece) -> Any:
        rows, columns = rows.on(kept.side), columns.on(kept.side)
        found = kept[rows.outer, columns.outer]
        return np.moveaxis(found, 0, -1) if kept.side == 0 else found

    def keep(self, name: str, side: int, inner: np.ndarray, rows: Piece, columns: Piece) -> None:
        """Keep `(..., h, w)` of one part for later stages."""
        if name not in self.kept:
            h, w = (-(-length // (side or 1)) for length in (self.rows.height, self.rows.width))
            self.kept[name] = Planes(self.folder, inner.shape[:-2], (h, w), side)
            self.files.callback(self.kept[name].file.close)
        self.kept[name][rows.on(side).inner, columns.on(side).inner] = inner


def strips(
    rows: Rows, method: Any, names: tuple[str, ...], tile: int, folder: Path | None = None
) -> Iterator[Strip]:
    """The denoised frame in strips from top to bottom."""
    scene = scene_of(rows)
    with ExitStack() as files:
        job = Job(rows, method, names, scene, tile, folder, files)
        job.known = method.known(sparse_images(job))
        *stages, last = method.stages()
        for stage in stages:
            _complete(job, stage)
        for y, x in job.places(last):
            given = job.run(last, y, x)
            yield y.start, {name: np.asarray(given[name])[y.kept] for name in last.names}


def _complete(job: Job, stage: Stage) -> None:
    """Run a stage on all parts of the frame."""
    sums = {name: np.float64(0) for name, _ in stage.totals}
    for y, x in job.places(stage):
        given = job.run(stage, y, x)
        for name, side in (*stage.gives, *stage.totals):
            found = np.asarray(given[name])
            found = np.moveaxis(found, -1, 0) if side == 0 else found
            inner = found[..., y.on(side).kept, x.on(side).kept]
            if name in sums:
                sums[name] = sums[name] + inner.sum((-2, -1), np.float64)
            else:
                job.keep(name, side, inner, y, x)
    if stage.learn is not None:
        totals = {name: jnp.float32(total) for name, total in sums.items()}
        job.known = job.known | stage.learn(job.method, job.known, totals)


def overlapping(
    rows: Rows, method: Any, names: tuple[str, ...], tile: int, whole: Any
) -> Iterator[Strip]:
    """The denoised frame in strips that overlap by all that its stages look at together.

    whole: gives for the images of a part what the last stage does. For methods that need no sums
    over the frame.
    """
    stages, scene = method.stages(), scene_of(rows)
    if any(stage.totals for stage in stages):
        raise ValueError(
            f"method {method.name} on opencl needs the whole frame in memory: raise --memory, or "
            "take the jax backend"
        )
    align = math.lcm(rows.factor, *(side or 1 for stage in stages for _, side in stage.gives))
    reach = sum(stage.reach for stage in stages) + method.margin
    for piece in pieces(rows.height, max(tile * tile // rows.width, 1), reach, align):
        images = method.images(rows.read(piece.low, piece.high), names, scene)
        given = whole(images)
        yield piece.start, {name: np.asarray(part)[piece.kept] for name, part in given.items()}


def sparse_images(job: Job) -> Parts:
    """The images of the few rows of a frame that typical values are told from, `(n, W, ...)`."""
    rows, margin, factor = job.rows, job.method.margin, job.rows.factor
    height = -(-rows.height // factor)
    lines = []
    for row in range(0, height, max(height // 32, 1)):
        low, high = max(row - margin, 0), min(row + 1 + margin, height)
        frame = rows.read(low * factor, min(high * factor, rows.height))
        images = _images(job.method, frame, job.names, job.scene) | {"guides_map": None}
        lines.append(jax.tree.map(lambda a, at=row - low: a[at : at + 1], images))
    return jax.tree.map(lambda *some: jnp.concatenate(some), *lines)


@functools.partial(jax.jit, static_argnames="names")
def _images(method: Any, frame: Frame, names: tuple[str, ...], scene: Scene) -> Parts:
    return method.images(frame, names, scene)


@functools.partial(jax.jit, static_argnames=("stage", "names"))
def _run(
    stage: Stage,
    method: Any,
    frame: Frame | None,
    names: tuple[str, ...],
    scene: Scene,
    parts: Parts,
    known: Known,
) -> Parts:
    """frame: None for a stage that reads no pixels."""
    images = {} if frame is None else method.images(frame, names, scene)
    return stage.run(method, images | parts, known)
