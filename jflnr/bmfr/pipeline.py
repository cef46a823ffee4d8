"""BMFR, the whole pipeline (Koskela et al. 2019, section 3): one frame in, one frame out.

The noisy light is accumulated over time (phase I), fitted by features in every block (phase II,
`fit.py`), and the fitted light accumulated again, then smoothed by TAA (phase III, `taa.py`).
What one frame leaves to the next is a `History`, so that `jax.lax.scan` goes over a sequence.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import checks
from jflnr.bmfr.fit import fit, grid_offset
from jflnr.bmfr.taa import smooth
from jflnr.camera import centres, from_centre
from jflnr.frame import Array, Frame
from jflnr.regression.division import divide
from jflnr.temporal.reproject import Surface, Taps, find_taps, gather

# Below this albedo the light cannot be told from the picture.
DARK = 1e-3
# What is not below this is no albedo, but garbage, and must not stay in the history.
WHITEST = 1e9
# What a byte holds; by then a new sample's share has long been its least.
MOST_SAMPLES = 255


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class BMFR:
    """The method, with the paper's constants. Alone, a frame is the first of a sequence.

    block: pixels on a side of what shares one fit. noise: half width of the uniform noise on
    features in [-1, 1]. The rest are the least shares of a new frame in what is accumulated:
    light_share in the noisy light, fitted_share in the fitted light, picture_share in TAA; 1 turns
    the accumulation off.
    """

    name: ClassVar[str] = "bmfr"
    features: ClassVar[tuple[str, ...]] = ("normal", "position")

    noise: jax.Array | float = 0.01
    light_share: jax.Array | float = 0.2
    fitted_share: jax.Array | float = 0.1
    picture_share: jax.Array | float = 0.2
    block: int = field(default=32, metadata={"static": True})

    def __post_init__(self) -> None:
        checks.positive_integer("block", self.block)

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> BMFR:
        return self

    def start(self, frame: Frame) -> History:
        """The history before the first frame: nothing in it can be taken over."""
        return start(frame)

    def step(self, history: History, frame: Frame) -> tuple[History, jax.Array]:
        """The next frame of a sequence, as `step` does."""
        return step(history, frame, self)


PAPER = BMFR()


class History(NamedTuple):
    """What a frame leaves to the next.

    number: how many frames there were, `()`. surface: of the last one; its depth is 0 where nothing
    can be taken over. samples: how many are in `light`, `(H, W, 1)`. light: the accumulated noisy
    light, fitted: the accumulated fitted light, picture: of that, multiplied by albedo, the
    result of TAA; all `(H, W, 3)`.
    """

    number: jax.Array | int
    surface: Surface
    samples: jax.Array
    light: jax.Array
    fitted: jax.Array
    picture: jax.Array


def start(frame: Frame) -> History:
    """The history before the first frame: nothing in it can be taken over."""
    surface = jax.tree.map(lambda layer: jnp.zeros(layer.shape, layer.dtype), Surface.of(frame))
    light = jnp.zeros(frame.normal.shape, jnp.float32)
    return History(jnp.int32(0), surface, light[..., :1], light, light, light)


@jax.jit
def step(history: History, frame: Frame, method: BMFR = PAPER) -> tuple[History, jax.Array]:
    """The next frame of a sequence.

    history: from `start` or the frame before. frame: with normal, depth, albedo and, where
    something moves, motion; without position, that relative to the camera is used.
    Returns the history for the next frame, and `(H, W, 3)`, demodulated indirect radiance, 0
    outside the mask. Samples that are not finite are left out.

    Raises `ValueError` for a layer of the wrong shape.
    """
    check(frame)
    moved, inside = motion(frame), coverage(frame) > 0
    taps = find_taps(moved, Surface.of(frame), history.surface)
    sample = jnp.where(inside, frame.indirect, jnp.nan)
    light, count = accumulate_light(taps, history, sample, method.light_share)
    sampled = jnp.where(count > 0, light, jnp.nan)
    number, offset = history.number, grid_offset(history.number, method.block)
    options: dict[str, Any] = {"block": method.block, "noise": method.noise, "squares": 3}
    fitted = fit(sampled, features(frame), inside, number, offset, **options)
    fitted = accumulate_fitted(taps, history, fitted, count, method.fitted_share)
    known = history.samples > 0
    albedo = jnp.asarray(frame.albedo)
    albedo = jnp.where(jnp.abs(albedo) < WHITEST, albedo, 0)
    picture = smooth(albedo * fitted, history.picture, known, moved, method.picture_share)
    bright = inside & (albedo > DARK)
    image = jnp.where(bright, divide(picture, albedo, DARK), fitted)
    # A pixel without a sample so far has nothing to hand on.
    surface = Surface.of(frame)._replace(depth=jnp.where(count > 0, frame.depth, 0))
    return History(history.number + 1, surface, count, light, fitted, picture), image


def check(frame: Frame) -> None:
    """Raise `ValueError` unless the layers fit together."""
    for name, channels in (("indirect", 3), ("normal", 3), ("albedo", 3), ("depth", 1)):
        checks.image(name, getattr(frame, name), channels)
    names = ("indirect", "normal", "albedo", "depth", "position", "mask", "motion")
    checks.same_size(**{name: getattr(frame, name) for name in names})


def motion(frame: Frame) -> Array:
    """The frame's motion, `(H, W, 2)`; if it has none, everything stays where it is."""
    return jnp.zeros((*frame.depth.shape[:2], 2)) if frame.motion is None else frame.motion


def coverage(frame: Frame) -> Array:
    """Above 0 where there is a surface to denoise, `(H, W, 1)`."""
    return frame.depth if frame.mask is None else frame.mask


def features(frame: Frame) -> jax.Array:
    """Normal and position, `(H, W, 6)`."""
    return jnp.concatenate([frame.normal, position(frame)], axis=-1)


def position(frame: Frame) -> Array:
    """The frame's position, `(H, W, 3)`.

    If it has none, that relative to the camera, but for factors that the scaling takes out.
    """
    if frame.position is not None:
        return frame.position
    height, width = frame.depth.shape[:2]
    across = from_centre(centres(width, height), width, height)
    rays = np.concatenate([across, np.ones_like(across[..., :1])], axis=-1)
    return frame.depth * jnp.asarray(rays, frame.depth.dtype)


def accumulate_light(
    taps: Taps, history: History, light: Array, least: Array | float
) -> tuple[jax.Array, jax.Array]:
    """Phase I: mean of the samples at each place, with an age limit (section 3.2).

    light: `(H, W, 3)`, this frame's. least: share of a new sample below which it does not fall.
    Returns the mean, `(H, W, 3)`, and the number of samples in it, `(H, W, 1)`, both 0 where there
    was none.
    """
    usable = jnp.all(jnp.isfinite(light), axis=-1, keepdims=True)
    count = jnp.minimum(jnp.round(gather(taps, history.samples)) + usable, MOST_SAMPLES)
    share = jnp.where(usable, jnp.maximum(1 / jnp.maximum(count, 1), least), 0)
    before = gather(taps, history.light)
    return before + share * (jnp.where(usable, light, 0) - before), count


def accumulate_fitted(
    taps: Taps, history: History, fitted: jax.Array, count: jax.Array, least: Array | float
) -> jax.Array:
    """Phase III: the same of the fitted light, with the sample count of phase I (section 3.5).

    fitted: `(H, W, 3)`. Returns `(H, W, 3)`.
    """
    share = jnp.where(taps.seen, jnp.maximum(1 / jnp.maximum(count, 1), least), 1)
    before = gather(taps, history.fitted)
    return before + share * (jnp.maximum(fitted, 0) - before)
