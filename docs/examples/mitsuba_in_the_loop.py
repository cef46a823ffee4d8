"""Denoise what Mitsuba 3 renders, from tensor to tensor: no files, and no copy on the way.

python docs/examples/mitsuba_in_the_loop.py
"""

from __future__ import annotations

import jax.numpy as jnp
import mitsuba as mi

import jflnr

# With depth 1, a path holds only the lamps and the sky that the camera sees.
INTEGRATOR = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal,depth:depth"}
INTEGRATOR |= {"image": {"type": "path"}, "lamps": {"type": "path", "max_depth": 1}}


def render_clean(scene: mi.Scene, spp: int = 1, seed: int = 0) -> mi.TensorXf:
    """A denoised picture (H, W, 3) of a scene with this integrator."""
    image = jnp.from_dlpack(mi.render(scene, spp=spp, seed=seed))
    pictures, guides = image[..., :-7], image[..., -7:]
    picture, lamps = (half[..., :3] for half in jnp.split(pictures, 2, axis=-1))  # without alpha
    albedo, normal, depth = jnp.split(guides, [3, 6], axis=-1)
    mask = (depth > 0) & (albedo.max(axis=-1, keepdims=True) > 0.01)
    light = mask * (picture - lamps) / jnp.maximum(albedo, 0.01)
    rest = picture - albedo * light  # passes through as it is
    layers = {"indirect": light, "albedo": albedo, "normal": normal, "depth": depth}
    frame = jflnr.Frame(**layers, mask=mask.astype(float), emission=rest)
    return mi.TensorXf(jflnr.composite(frame, jflnr.denoise(frame, guides=("normal", "depth"))))


if __name__ == "__main__":
    mi.set_variant("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")  # the first that works here
    room = mi.cornell_box() | {"integrator": INTEGRATOR}
    mi.util.write_bitmap("cornell_box.png", render_clean(mi.load_dict(room)))
