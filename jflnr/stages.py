"""What a method does, as stages: pure functions that a driver may run on parts of a frame."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from jflnr.lazy import jit, jnp

# Arrays by name. Pixels lie in `(H, W, C)`, what is on blocks in `(..., h, w)`.
Parts: TypeAlias = dict[str, Any]
# What is known of the whole frame, by name.
Known: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Stage:
    """One pure function, and what a driver must know to run it on a part of a frame.

    run: from the method, the arrays and what is known, all of them of one part, to new arrays.
    gives: their names, each with the side in pixels of the blocks that it is on; 0 for pixels.
    reads: what it takes of what stages before it gave. pixels: whether it takes the images too.
    reach: pixels beyond a part that its results depend on. align: parts begin at multiples of so
    many pixels. totals: planes `(n, ...)` whose sums over the frame are wanted, given beside the
    others, with the side of their blocks. learn: what those sums, `(n,)` each, add to what is
    known. composes: whether it puts the light into the picture, which needs pixels only.
    """

    run: Callable[[Any, Parts, Known], Parts]
    gives: tuple[tuple[str, int], ...]
    reads: tuple[str, ...] = ()
    pixels: bool = False
    reach: int = 0
    align: int = 1
    totals: tuple[tuple[str, int], ...] = ()
    learn: Callable[[Any, Known, dict[str, Any]], Known] | None = None
    composes: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Those of what it gives."""
        return tuple(name for name, _ in self.gives)


def run(stages: Sequence[Stage], method: Any, parts: Parts, known: Known) -> tuple[Parts, Known]:
    """All stages on a whole frame: the arrays of each and all that became known."""
    for stage in stages:
        given = stage.run(method, parts, known)
        if stage.learn is not None:
            sums = {name: jnp.sum(given.pop(name), axis=(-2, -1)) for name, _ in stage.totals}
            known = known | stage.learn(method, known, sums)
        parts = parts | given
    return parts, known


def regress(method: Any, images: Parts) -> Parts:
    """What the last stage of a method gives for a whole frame: `image`, `(H, W, C)`, and more.

    images: as the method's `images` makes them.
    """
    stages = method.stages()
    parts, _ = run(stages, method, images, method.known(images))
    return {name: parts[name] for name in stages[-1].names}


@functools.partial(jit, static_argnames="names")
def on_frame(method: Any, frame: Any, names: tuple[str, ...]) -> Parts:
    """`regress` on the images that the method makes of a whole frame."""
    return regress(method, method.images(frame, names))
