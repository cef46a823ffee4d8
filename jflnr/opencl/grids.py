"""Grids of blocks on the device, as kernels_cl/grids.h describes them."""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jflnr.opencl.context import Context
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.level import brightness
from jflnr.regression.window import REACH

# The light, the guides of the fit, what each pixel counts and the guides that models are evaluated
# on, on the device.
Images: TypeAlias = "tuple[Any, tuple[Any, ...], Any | None, tuple[Any, ...]]"
# Neighbours whose planes lie together.
GROUP = 8


class Grid(NamedTuple):
    """Planes over h x w blocks: `(h, pitch / GROUP, count, GROUP)` on the device."""

    planes: Any
    w: int

    @property
    def number(self) -> int:
        """Of planes."""
        return int(self.planes.shape[2])

    @property
    def size(self) -> tuple[int, int]:
        """h and pitch."""
        h, groups = self.planes.shape[:2]
        return int(h), int(groups) * GROUP

    @property
    def sizes(self) -> tuple[int, int, int]:
        """h, w and pitch, as the kernels take them."""
        h, pitch = self.size
        return h, self.w, pitch


class Run(NamedTuple):
    """What the steps of one run of adaptive FLR share.

    guides, channels: the numbers Q and C. numbers: the constants themselves, not their logarithms.
    shift: `(max(Q, 1),)`, what guides are measured from. mean: `(2,)`, mean and sum of the frame's
    brightness.
    """

    context: Context
    guides: int
    channels: int
    numbers: AdaptiveFLR
    shift: Any
    mean: Any

    def grid(self, count: int, h: int, w: int) -> Grid:
        """A new one, of `count` planes."""
        return Grid(self.context.empty((h, -(-w // GROUP), count, GROUP)), w)

    def launch(
        self,
        name: str,
        file: str,
        grid: Grid,
        arguments: Sequence[Any],
        down: bool = False,
        **defines: int,
    ) -> None:
        """Run a kernel on the blocks of a grid, WIDTH neighbours per work-item.

        down: neighbouring work-items are below each other.
        """
        width = defines.setdefault("WIDTH", self.context.width())
        everywhere = {"Q": self.guides, "C": self.channels, "REACH": REACH}
        everywhere |= brightness_defines(self.channels)
        h, pitch = grid.size
        size = (h, pitch // width) if down else (pitch // width, h)
        self.context.run(name, file, everywhere | defines, size, arguments)


def lanes_of(run: Run, block: int) -> int:
    """Pixels that are worked on together: of two blocks side by side, or what divides one."""
    both = run.context.width(2 * block)
    return both if both == 2 * block else run.context.width(block)


@functools.cache
def brightness_defines(channels: int) -> dict[str, Any]:
    """The defines of kernels_cl/sizes.h for the brightness of an image of C channels."""
    weights = brightness(channels, np.float32).tolist()
    return {f"BRIGHTNESS_{i}": f"{weights[i % channels]:.8f}f" for i in range(3)}
