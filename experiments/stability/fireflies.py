"""Heavy-tailed noise: what a robust fit buys, and what it costs in bias."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data
from experiments.stability.cases import room
from experiments.stability.methods import SUPPORT
from jflnr.regression.parameters import DEFAULT
from jflnr.regression.flr import flr
from jflnr.guides import choose, layers

SIZE = 36, 44
PROBABILITY, ENERGY = 5e-5, 0.2  # of a firefly per sample; its share of the other light
FITS = ("plain", "clamp at 50", "clamp at 10", "clamp at 3", "one reweighting")


@jax.jit
def _fit(y: jax.Array, x: jax.Array, weight: jax.Array) -> jax.Array:
    return flr(y, x, DEFAULT, support=SUPPORT, weight=weight)


def fit(
    name: str, noisy: np.ndarray, guides: np.ndarray, usable: np.ndarray | None = None
) -> np.ndarray:
    """Light `(H, W)` by one of `FITS`, from the pixels `usable`, all if None.

    clamp at k: samples above k times the frame's median of positive ones are cut to that.
    one reweighting: a plain fit first, then one where a pixel that lies r times the typical
    residual away counts 1 / max(1, r / 3) (Huber's weights).
    """
    x, weight = jnp.float32(guides), jnp.ones(noisy.shape, jnp.float32)
    if usable is not None:
        weight = weight * usable
    if name.startswith("clamp"):
        noisy = np.minimum(noisy, float(name.split()[-1]) * np.median(noisy[noisy > 0]))
    y = jnp.float32(noisy[..., None])
    light = _fit(y, x, weight)
    if name == "one reweighting":
        away = jnp.abs(y - light)[..., 0]
        light = _fit(y, x, weight / jnp.maximum(1, away / (3 * jnp.median(away))))
    return np.asarray(light)[..., 0]


def samples(spp: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Noisy light `(H, W)`, its expectation and the guides.

    Every sample is exponential; few carry, on top, `ENERGY / PROBABILITY` times the light: with
    more samples per pixel more windows hold a firefly, and each tilts the fit of a whole window.
    """
    r = room(*SIZE, np.float32, seed)
    light = r.light()
    shape = (spp, *light.shape)
    rare = (r.rng.random(shape) < PROBABILITY) * (ENERGY / PROBABILITY)
    noisy = (light * (r.rng.exponential(size=shape) + rare)).mean(0)
    return noisy, light * (1 + ENERGY), r.guides


def run(quick: bool) -> list[dict[str, Any]]:
    """Per sample count and fit: how far from the light, and how much of that stays on average."""
    rows = []
    seeds = 4 if quick else 40
    for spp in (1, 16):
        made = [samples(spp, seed) for seed in range(seeds)]
        for name in FITS:
            off = np.stack([fit(name, noisy, x) - light for noisy, light, x in made])
            scale = float(np.mean(made[0][1]))
            rows.append(
                {
                    "spp": spp,
                    "fit": name,
                    "typical": float(np.median(np.sqrt(np.mean(off**2, (1, 2))))) / scale,
                    "error": float(np.sqrt(np.mean(off**2))) / scale,
                    "bias": float(np.mean(off)) / scale,
                }
            )
    return rows


def real(quick: bool) -> list[dict[str, Any]]:
    """The same on real frames, of the brightness in the mask; veach-lamp is lit by small lamps
    inside shades."""
    rows = []
    for path in data.frames("val")[:1] if quick else data.frames("val"):
        for spp in (1, 16):
            frame = jflnr.read_frame(path, spp)
            assert frame.reference is not None
            guides = np.concatenate(layers(frame, choose(frame, None)), axis=-1)
            noisy, light = (np.mean(a, axis=-1) for a in (frame.indirect, frame.reference))
            usable = light >= 0 if frame.mask is None else np.asarray(frame.mask)[..., 0] > 0
            for name in FITS:
                off = (fit(name, noisy, guides, usable) - light)[usable] / light[usable].mean()
                rows.append(
                    {
                        "frame": data.label(path),
                        "spp": spp,
                        "fit": name,
                        "typical": float(np.median(np.abs(off))),
                        "error": float(np.sqrt(np.mean(off**2))),
                        "bias": float(np.mean(off)),
                    }
                )
    return rows
