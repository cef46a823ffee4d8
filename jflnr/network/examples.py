"""Training examples: crops of frames under ever new noise, with all that precedes the network."""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jflnr import exr
from jflnr.frame import Frame, read_frame
from jflnr.images.inputs import frame_inputs
from jflnr.metrics import MEAN_BRIGHTNESS
from jflnr.network import features
from jflnr.network.augment import augment
from jflnr.network.flnr import DEFAULT
from jflnr.stages import Known, Parts, run

# Sides of a crop: whole blocks on the coarsest grid, so that flipping a crop flips all grids.
HEIGHT, WIDTH = 160, 320
# Samples per pixel that are trained on, and how often.
SHARES = {1: 0.85, 2: 0.05, 4: 0.05, 16: 0.05}
NOISY = re.compile(r"indirect_(\d+)(_[a-z])?\.R")
# A crop that shows little but sky teaches little.
LEAST_SURFACE = 0.2


class Crop(NamedTuple):
    """A part of a frame, and its light under several realisations of the noise.

    light: by samples per pixel, `(N, H, W, 3)`.
    """

    frame: Frame
    light: dict[int, np.ndarray]


class Example(NamedTuple):
    """One crop under one realisation of the noise.

    parts, known: what precedes the network. albedo: `(H, W, 3)`. target: `(H, W, 3)`, what the
    reflected light should be, as exposed on the screen. exposure: the factor for that.
    """

    parts: Parts
    known: Known
    albedo: Any
    target: Any
    exposure: Any


def read(paths: Sequence[Path], seed: int) -> Iterator[list[Crop]]:
    """The crops of every frame, file by file.

    The target is the layer `reference`. A frame without one must have two noisy layers of as many
    samples: each is then the target of the others.
    Raises `ValueError` for a frame that is too small or that lacks a layer.
    """
    for path in paths:
        random = np.random.default_rng([seed, *path.name.encode()])
        frame, light = _layers(path)
        height, width = frame.depth.shape[:2]
        places = _places(height, width, random)
        found = (
            Crop(_cut(frame, at), {spp: a[:, *at] for spp, a in light.items()}) for at in places
        )
        yield [crop for crop in found if _teaches(crop)]


def _layers(path: Path) -> tuple[Frame, dict[int, np.ndarray]]:
    """The frame, and its noisy layers by samples per pixel, `(N, H, W, 3)`."""
    channels = exr.read_channels(path)
    found: dict[int, list[np.ndarray]] = {}
    for name in sorted(channels):
        if (match := NOISY.fullmatch(name)) and int(match[1]) in SHARES:
            layer = np.stack([channels[f"{name[:-1]}{c}"] for c in "RGB"], axis=-1)
            found.setdefault(int(match[1]), []).append(layer)
    if not found:
        raise ValueError(
            f"{path}: no noisy layer indirect_N with N one of {', '.join(map(str, SHARES))}"
        )
    frame = read_frame(path, next(iter(found)))
    least = 1 if frame.reference is not None else 2
    light = {spp: np.stack(layers) for spp, layers in found.items() if len(layers) >= least}
    if not light or frame.ao is None:
        raise ValueError(f"{path}: needs a layer ao, and reference or two of the same indirect_N")
    kept = frame_inputs(frame, features.GUIDES)
    return dataclasses.replace(kept, albedo=frame.albedo, reference=frame.reference), light


def _places(height: int, width: int, random: np.random.Generator) -> Iterator[tuple[slice, slice]]:
    """Crops of `HEIGHT` x `WIDTH` pixels side by side, the first at a random place."""
    if height < HEIGHT or width < WIDTH:
        raise ValueError(f"frames of {width} x {height}: they must be {WIDTH} x {HEIGHT} at least")
    top, left = random.integers(height % HEIGHT + 1), random.integers(width % WIDTH + 1)
    for y in range(top, height - HEIGHT + 1, HEIGHT):
        for x in range(left, width - WIDTH + 1, WIDTH):
            yield slice(y, y + HEIGHT), slice(x, x + WIDTH)


def _cut(frame: Frame, place: tuple[slice, slice]) -> Frame:
    return jax.tree.map(lambda a: a[place].copy(), frame)


def _teaches(crop: Crop) -> bool:
    surface = 1 if crop.frame.mask is None else np.mean(crop.frame.mask)
    light = np.mean(crop.frame.albedo * _wanted(crop))
    return bool(surface >= LEAST_SURFACE and 0 < light < np.inf)


def _wanted(crop: Crop) -> np.ndarray:
    """What its mean brightness is taken from: the reference, or else the mean of what there is."""
    if crop.frame.reference is not None:
        return np.asarray(crop.frame.reference)
    return np.asarray(np.mean(crop.light[max(crop.light)], axis=0, dtype=np.float32))


def draw(crop: Crop, random: np.random.Generator) -> Example:
    """The crop under a new realisation of the noise, with what precedes the network."""
    frame, exposure = renewed(crop, random)
    return Example(*prepared(frame), frame.albedo, shown(frame, exposure), exposure)


def renewed(crop: Crop, random: np.random.Generator) -> tuple[Frame, np.float32]:
    """The crop under a new realisation of the noise, mixed from those that there are, mirrored and
    recoloured, with its target as `reference`; and its exposure."""
    counts = sorted(crop.light)
    shares = np.array([SHARES[spp] for spp in counts])
    layers = crop.light[counts[random.choice(len(counts), p=shares / shares.sum())]]
    target = crop.frame.reference
    if target is None:
        layers = random.permutation(layers)
        layers, target = layers[1:], layers[0].astype(np.float32)
    frame = dataclasses.replace(crop.frame, indirect=mixed(layers, random), reference=target)
    exposure = np.float32(MEAN_BRIGHTNESS / np.mean(crop.frame.albedo * _wanted(crop)))
    return augment(frame, random), exposure


def shown(frame: Frame, exposure: np.float32) -> np.ndarray:
    """The reflected light that is wanted of a frame, as exposed, `(H, W, 3)`."""
    return np.clip(np.asarray(frame.albedo) * frame.reference * exposure, 0, 1e4)


def mixed(images: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Each pixel from one of the images `(N, H, W, 3)`; `(H, W, 3)` in float32.

    Pixels have random streams of their own, so this is as good a realisation as any of them, and
    without such the network learns the few that there are by heart.
    """
    chosen = random.integers(len(images), size=(1, *images.shape[1:3], 1))
    return np.take_along_axis(images, chosen, axis=0)[0].astype(np.float32)


def prepared(frame: Frame) -> tuple[Parts, Known]:
    """What precedes the network for one frame: arrays, and what is known of the whole."""
    return jax.tree.map(np.asarray, _prepared(frame_inputs(frame, features.GUIDES)))


@jax.jit
def _prepared(frame: Frame) -> tuple[Parts, Known]:
    images = DEFAULT.images(frame, features.GUIDES)
    parts, known = run(DEFAULT.before_network(), DEFAULT, images, DEFAULT.known(images))
    kept = {name: parts[name] for name in ("read", "output", "moments")}
    return kept | {"guides": jnp.concatenate(images["guides"], axis=-1)}, known


def has_reference(path: Path) -> bool:
    """Whether the frame can be trained towards a reference."""
    return "reference.R" in exr.read_channels(path)


def digest(paths: Sequence[Path]) -> str:
    """SHA-256 over names and sizes of the files, in order: what was trained on."""
    text = "\n".join(f"{path.name} {path.stat().st_size}" for path in paths)
    return hashlib.sha256(text.encode()).hexdigest()
