"""The hard cases of the stability atlas, each made at any size and in any storage type.

Every case is a room corner seen by guides like those of a frame, with light that is affine in them
and the noise of one sample per pixel, spoiled in one way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

Type = np.dtype | type


class Case(NamedTuple):
    """One problem. Everything is as stored, so that the truth starts from the same numbers.

    target: `(H, W, 2)`, the noisy light and the light without noise; what a linear method makes of
    the latter is the mean of what it makes of the noise. guides: `(H, W, Q)`.
    usable: `(H, W)`, False where masked out. edge: `(H, W)`, pixels within 3 of a step in the
    light, or None.
    """

    target: np.ndarray
    guides: np.ndarray
    usable: np.ndarray
    edge: np.ndarray | None = None


class Room(NamedTuple):
    """What the cases start from, float64."""

    rng: np.random.Generator
    dtype: Type
    x: np.ndarray  # (H, W), 0 to 1
    y: np.ndarray
    guides: np.ndarray  # (H, W, 5): normal, depth, ambient occlusion
    edge: np.ndarray

    def case(
        self,
        guides: np.ndarray | None = None,
        light: np.ndarray | None = None,
        noisy: np.ndarray | None = None,
        usable: np.ndarray | None = None,
        edge: bool = True,
    ) -> Case:
        """A case of this room with some of its parts replaced."""
        guides = self.guides if guides is None else guides
        light = self.light() if light is None else light
        noisy = self.one_sample(light) if noisy is None else noisy
        usable = np.ones(light.shape, bool) if usable is None else usable
        target = np.stack(np.broadcast_arrays(noisy, light), -1)
        with np.errstate(over="ignore"):
            stored = target.astype(self.dtype), guides.astype(self.dtype)
        return Case(*stored, usable, self.edge if edge else None)

    def light(self) -> np.ndarray:
        """Affine in the guides, between about 0.3 and 1.3."""
        return 0.3 + 0.4 * self.guides[..., 0] + 0.3 * self.guides[..., 3] * self.guides[..., 4]

    def one_sample(self, light: np.ndarray) -> np.ndarray:
        return light * self.rng.exponential(size=light.shape)


def room(height: int, width: int, dtype: Type, seed: int = 0) -> Room:
    """A wall that meets a bulging one at the middle column, darker towards the corner."""
    y, x = np.mgrid[:height, :width] / max(height, width)
    left = np.broadcast_to(np.arange(width) < width // 2, x.shape)
    bulge = 0.5 * np.sin(3 * y)
    normal = np.stack([left, ~left * np.sin(bulge), ~left * np.cos(bulge)], -1)
    corner = np.abs(x - 0.5 * width / max(height, width))
    depth, occlusion = 1 - 0.5 * corner, 0.4 + 0.6 * np.minimum(3 * corner, 1)
    guides = np.concatenate([normal, depth[..., None], occlusion[..., None]], -1)
    edge = np.broadcast_to(np.abs(np.arange(width) - width // 2 + 0.5) < 3, x.shape)
    return Room(np.random.default_rng(seed), dtype, x, y, guides, edge)


def _ordinary(r: Room) -> Case:
    return r.case()


def _constant_guide(r: Room) -> Case:
    return r.case(np.where(np.arange(5) == 4, 1, r.guides))


def _equal_guides(r: Room) -> Case:
    return r.case(r.guides[..., [0, 0, 2, 3, 4]])


def _nearly_equal_guides(r: Room) -> Case:
    near = r.guides[..., 0] + 1e-6 * np.sin(40 * r.x + 20 * r.y)
    return r.case(np.concatenate([near[..., None], r.guides[..., [0, 2, 3, 4]]], -1))


def _far_from_the_origin(r: Room) -> Case:
    return r.case(r.guides * 0.1 + 1e4)


def _small_and_large(r: Room) -> Case:
    return r.case(r.guides * [1e-4, 1e4, 1e-4, 1e4, 1])


def _black(r: Room) -> Case:
    return r.case(light=0 * r.x, edge=False)


def _single_lit_pixel(r: Room) -> Case:
    noisy = np.zeros(r.x.shape)
    noisy[r.x.shape[0] // 2, r.x.shape[1] // 3] = 1000
    return r.case(light=0 * r.x, noisy=noisy, edge=False)


def _fireflies(r: Room) -> Case:
    light = r.light()
    noisy = np.where(r.rng.random(light.shape) < 2e-3, 1e4, r.one_sample(light))
    return r.case(noisy=noisy)


def _more_guides_than_directions(r: Room) -> Case:
    mix = r.rng.standard_normal((5, 11))
    return r.case(np.concatenate([r.guides, r.guides @ mix], -1))


def _one_pixel_wide(r: Room) -> Case:
    stripe = np.broadcast_to(np.arange(r.x.shape[1]) % 11 == 0, r.x.shape)
    guides = np.concatenate([stripe[..., None], r.guides[..., 1:]], -1)
    return r.case(guides, light=0.3 + stripe + 0.2 * r.guides[..., 4], edge=False)


def _border_only(r: Room) -> Case:
    """Of the frame only the outermost pixels can be used: a line one pixel wide."""
    usable = np.ones(r.x.shape, bool)
    usable[1:-1, 1:-1] = False
    return r.case(usable=usable, edge=False)


def _half_masked(r: Room) -> Case:
    """Beyond the mask the depth says infinitely far, as renderers write for the sky."""
    usable = (r.x + r.y < 0.6) | (r.rng.random(r.x.shape) < 0.1)
    far = r.guides.copy()
    far[..., 3] = np.where(usable, far[..., 3], 1e30)
    return r.case(far, noisy=np.where(usable, r.one_sample(r.light()), 0), usable=usable)


def _step_in_flat_region(r: Room) -> Case:
    flat = np.where(np.arange(5) == 0, r.guides, np.array([0, 0, 1, 1, 1]))
    return r.case(flat, light=0.2 + r.guides[..., 0])


def _plane(r: Room) -> Case:
    """Normals that differ by rounding only, and a depth affine in the pixel."""
    normal = np.array([0.6, 0, 0.8]) + 1e-7 * r.rng.standard_normal((*r.x.shape, 3))
    depth = 1 + 0.3 * r.x
    guides = np.concatenate([normal, depth[..., None], np.ones((*r.x.shape, 1))], -1)
    return r.case(guides, light=0.2 + 0.5 * depth, edge=False)


def _negative_radiance(r: Room) -> Case:
    return r.case(light=-r.light())


def _subnormal_radiance(r: Room) -> Case:
    scale = float(jnp.finfo(r.dtype).tiny) / 4
    return r.case(light=r.light() * scale)


def _subnormal_guide(r: Room) -> Case:
    scale = float(jnp.finfo(r.dtype).tiny) / 4
    return r.case(r.guides * np.where(np.arange(5) == 0, scale, 1))


def _radiance_near_maximum(r: Room) -> Case:
    light = r.light() * _large(r.dtype)
    return r.case(light=light, noisy=np.minimum(r.one_sample(light), 2.5 * _large(r.dtype)))


def _guide_near_maximum(r: Room) -> Case:
    return r.case(np.where(np.arange(5) == 0, r.guides * 2.5 * _large(r.dtype), r.guides))


def _large(dtype: Type) -> float:
    """A third of the largest number (of float32 where the type reaches further)."""
    return min(float(jnp.finfo(dtype).max), float(np.finfo(np.float32).max)) / 3


CASES: dict[str, Callable[[Room], Case]] = {
    "ordinary": _ordinary,
    "constant guide": _constant_guide,
    "two equal guides": _equal_guides,
    "guides 1e-6 apart": _nearly_equal_guides,
    "guides at 1e4 + 0.1": _far_from_the_origin,
    "guides of 1e-4 and 1e4": _small_and_large,
    "16 guides, rank 5": _more_guides_than_directions,
    "normals of a plane": _plane,
    "1-pixel stripes": _one_pixel_wide,
    "1-pixel border": _border_only,
    "step in a flat region": _step_in_flat_region,
    "half masked, far sky": _half_masked,
    "black": _black,
    "one lit pixel": _single_lit_pixel,
    "fireflies of 1e4": _fireflies,
    "negative radiance": _negative_radiance,
    "subnormal radiance": _subnormal_radiance,
    "subnormal guide": _subnormal_guide,
    "radiance near maximum": _radiance_near_maximum,
    "guide near maximum": _guide_near_maximum,
}


def make(name: str, height: int, width: int, dtype: Type = np.float32) -> Case:
    """The case of that name."""
    return CASES[name](room(height, width, dtype))
