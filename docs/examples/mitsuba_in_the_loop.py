"""Denoise what Mitsuba 3 renders, from tensor to tensor: no files, and no copy on the way.

    python docs/examples/mitsuba_in_the_loop.py
"""

from __future__ import annotations

import jax.numpy as jnp
import mitsuba as mi

import jflnr

AOVS = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal,depth:depth"}


def render_clean(scene: mi.Scene, spp: int = 1, seed: int = 0) -> mi.TensorXf:
    """A denoised picture (H, W, 3). The scene's integrator is `AOVS` around one with RGBA."""
    image = jnp.from_dlpack(mi.render(scene, spp=spp, seed=seed))
    picture, albedo, normal, depth = jnp.split(image[..., [0, 1, 2, *range(4, 11)]], [3, 6, 9], -1)
    surface = (depth > 0) & (albedo.max(-1, keepdims=True) > 0.01)
    albedo = jnp.where(surface, albedo, 0)
    light = jnp.where(albedo > 0.01, picture / jnp.maximum(albedo, 0.01), 0)
    rest = picture - albedo * light  # lamps, sky, mirrors: passes through as it is
    frame = jflnr.Frame(light, albedo, normal, depth, mask=surface.astype(float), emission=rest)
    return mi.TensorXf(jflnr.composite(frame, jflnr.denoise(frame, guides=("normal", "depth"))))


if __name__ == "__main__":
    mi.set_variant("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")  # the first that works here
    room = mi.cornell_box()
    room["integrator"] = AOVS | {"image": {"type": "path"}}
    mi.util.write_bitmap("cornell_box.png", render_clean(mi.load_dict(room)))
