"""Other frames from one: mirrored, with other colours."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np

from jflnr.frame import Frame
from jflnr.network import features

COLOURED = ("indirect", "albedo", "reference")


def augment(frame: Frame, random: np.random.Generator) -> Frame:
    """Mirror the frame and permute its channels, at random.

    Normals are not turned: to a regression they are three guides like any others.
    """
    order = random.permutation(features.CHANNELS)
    axes = tuple(axis for axis in (0, 1) if random.random() < 0.5)
    coloured = {
        name: layer[..., order] for name in COLOURED if (layer := getattr(frame, name)) is not None
    }
    frame = dataclasses.replace(frame, **coloured)
    return jax.tree.map(lambda layer: np.ascontiguousarray(np.flip(layer, axes)), frame)
