"""Grids of blocks on the device, as kernels_cl/grids.h describes them."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp

from jflnr.flr.adaptive_parameters import AdaptiveParameters
from jflnr.flr.level import brightness
from jflnr.flr.window import REACH
from jflnr.opencl.context import Context

GROUP = 8
MARGIN = -(-REACH // GROUP) * GROUP


class Run(NamedTuple):
    """What the steps of one run of adaptive FLR share.

    guides, channels: the numbers Q and C. numbers: the constants themselves, not their logarithms.
    shift: `(max(Q, 1),)`, what guides are measured from. mean: `(2,)`, mean and sum of the frame's
    brightness.
    """

    context: Context
    guides: int
    channels: int
    numbers: AdaptiveParameters
    shift: Any
    mean: Any

    def launch(self, name: str, file: str, size: Any, arguments: Any, **defines: int) -> None:
        """Run a kernel that handles `size` blocks, WIDTH neighbours per work-item."""
        width = self.context.width()
        everywhere = {"Q": self.guides, "C": self.channels, "WIDTH": width}
        everywhere |= {"REACH": REACH, "MARGIN": MARGIN} | brightness_defines(self.channels)
        size = (-(-size[0] // width), *size[1:])
        self.context.run(name, file, everywhere | defines, size, arguments)


class Grid(NamedTuple):
    """Moments at one size of block.

    moments: `(K + 1, h, stride)`, the last plane of noise, or `(K, h, stride)`. w: number of blocks
    across. block: side in pixels.
    """

    moments: Any
    w: int
    block: int

    @property
    def h(self) -> int:
        return int(self.moments.shape[1])


def pitch_of(w: int) -> int:
    """Blocks in a row, with those that only fill it up."""
    return -(-w // GROUP) * GROUP


def stride_of(w: int) -> int:
    """The same, with zeros on both sides for the window."""
    return pitch_of(w) + 2 * MARGIN


@functools.cache
def brightness_defines(channels: int) -> dict[str, Any]:
    """The defines of kernels_cl/sizes.h for the brightness of an image of C channels."""
    weights = brightness(channels, jnp.float32).tolist()
    return {f"BRIGHTNESS_{i}": f"{weights[i % channels]:.8f}f" for i in range(3)}
