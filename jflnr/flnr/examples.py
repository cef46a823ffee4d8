"""Training examples: crops of frames, with all that does not depend on the network done once."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import exr
from jflnr.flnr import features
from jflnr.flnr.regression import Prepared, prepare
from jflnr.frame import Frame, read_frame
from jflnr.inputs import adaptive_images, frame_inputs
from jflnr.metrics import MEAN_BRIGHTNESS

# Sides of a crop: whole blocks on the coarsest grid, so that flipping a crop flips all grids.
HEIGHT, WIDTH = 160, 320
# Noisy layers that are trained on, and how often for one of 1 spp.
SHARES = {1: 1.0, 2: 0.35, 4: 0.35, 16: 0.35}
# Further realisations of 1 spp per frame, drawn pixel by pixel from those that there are.
MIXES = 6
NOISY = re.compile(r"indirect_(\d+)(_[a-z])?\.R")
# A crop that shows little but sky teaches little.
LEAST_SURFACE = 0.2


class Example(NamedTuple):
    """One crop under one realisation of the noise.

    guides: `(H, W, Q)`. shift: `(Q,)`. albedo: `(H, W, 3)`. target: `(H, W, 3)`, what the
    reflected light should be, as exposed on the screen. exposure: the factor for that. share: how
    often it is drawn.
    """

    prepared: Prepared
    shift: Any
    guides: Any
    albedo: Any
    target: Any
    exposure: Any
    share: Any


def read(paths: Sequence[Path], seed: int) -> Iterator[list[Example]]:
    """The examples of every frame, file by file.

    The target is the layer `reference`. A frame without one must have two noisy layers of as many
    samples: each is then the target of the other.
    Raises `ValueError` for a frame that is too small or that lacks a layer.
    """
    for path in paths:
        random = np.random.default_rng([seed, *path.name.encode()])
        found = []
        for spp, frame in realisations(path, random):
            for crop in crops(frame, random):
                if (example := _example(crop, SHARES[spp])) is not None:
                    found.append(example)
        yield found


def realisations(path: Path, random: np.random.Generator) -> list[tuple[int, Frame]]:
    """The frame with each noisy layer that is trained on, and its samples per pixel."""
    channels = exr.read_channels(path)
    noisy = {m[0][:-2]: int(m[1]) for name in sorted(channels) if (m := NOISY.fullmatch(name))}
    noisy = {name: spp for name, spp in noisy.items() if spp in SHARES}
    if not noisy:
        raise ValueError(
            f"{path}: no noisy layer indirect_N with N one of {', '.join(map(str, SHARES))}"
        )
    frame = read_frame(path, next(iter(noisy.values())))
    light = {n: np.stack([channels[f"{n}.{c}"] for c in "RGB"], axis=-1) for n in noisy}
    light = {name: image.astype(np.float32) for name, image in light.items()}
    found = []
    for name, spp in noisy.items():
        target = frame.reference
        if target is None:
            others = [other for other in noisy if noisy[other] == spp and other != name]
            if not others:
                continue
            target = light[others[0]]
        found.append((spp, dataclasses.replace(frame, indirect=light[name], reference=target)))
    if not found or frame.ao is None:
        raise ValueError(f"{path}: needs a layer ao, and reference or two of the same indirect_N")
    ones = [own.indirect for spp, own in found if spp == 1]
    if frame.reference is not None and len(ones) > 1:
        mixes = (mixed(np.stack(ones), random) for _ in range(MIXES))
        found += [(1, dataclasses.replace(frame, indirect=image)) for image in mixes]
    return found


def mixed(images: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Each pixel from one of the images `(N, H, W, 3)`.

    Pixels have random streams of their own, so this is as good a realisation as any of them, and
    without such the network learns the few that there are by heart.
    """
    chosen = random.integers(len(images), size=(1, *images.shape[1:3], 1))
    return np.take_along_axis(images, chosen, axis=0)[0]


def crops(frame: Frame, random: np.random.Generator) -> Iterator[Frame]:
    """Parts of `HEIGHT` x `WIDTH` pixels side by side, the first at a random place."""
    height, width = frame.depth.shape[:2]
    if height < HEIGHT or width < WIDTH:
        raise ValueError(f"frames of {width} x {height}: they must be {WIDTH} x {HEIGHT} at least")
    top, left = random.integers(height % HEIGHT + 1), random.integers(width % WIDTH + 1)
    for y in range(top, height - HEIGHT + 1, HEIGHT):
        for x in range(left, width - WIDTH + 1, WIDTH):
            yield jax.tree.map(lambda a, y=y, x=x: a[y : y + HEIGHT, x : x + WIDTH], frame)


def prepared(frame: Frame) -> tuple[Prepared, np.ndarray, np.ndarray]:
    """What precedes the network for one frame, the shift and the guides `(H, W, Q)`."""
    return jax.tree.map(np.asarray, _prepared(frame_inputs(frame, features.GUIDES)))


@functools.partial(jax.jit)
def _prepared(frame: Frame) -> tuple[Prepared, jax.Array, jax.Array]:
    images = adaptive_images(frame, features.GUIDES)
    known, shift = prepare(images["target"], images["guides"], images["weight"])
    return known, shift, jnp.concatenate(images["guides"], axis=-1)


def _example(frame: Frame, share: float) -> Example | None:
    target = np.asarray(frame.albedo) * frame.reference
    surface = 1 if frame.mask is None else np.mean(frame.mask)
    if surface < LEAST_SURFACE or not 0 < (mean := np.mean(target)) < np.inf:
        return None
    known, shift, guides = prepared(frame)
    exposure = np.float32(MEAN_BRIGHTNESS / mean)
    return Example(
        known._replace(x=known.x.astype(np.float16)),
        shift,
        guides,
        np.asarray(frame.albedo, np.float16),
        np.clip(target * exposure, 0, 1e4).astype(np.float16),
        exposure,
        np.float32(share),
    )


def has_reference(path: Path) -> bool:
    """Whether the frame can be trained towards a reference."""
    return "reference.R" in exr.read_channels(path)


def digest(paths: Sequence[Path]) -> str:
    """SHA-256 over names and sizes of the files, in order: what was trained on."""
    text = "\n".join(f"{path.name} {path.stat().st_size}" for path in paths)
    return hashlib.sha256(text.encode()).hexdigest()
