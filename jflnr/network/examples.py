"""Training examples: crops of frames under ever other noise, with all that precedes the network."""

import dataclasses
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jflnr import exr
from jflnr.files import replacing
from jflnr.frame import Frame, read_frame
from jflnr.images.inputs import frame_inputs
from jflnr.metrics import display, exposure
from jflnr.network import flnr
from jflnr.network.features import BRIGHTEST, Read
from jflnr.network.flnr import FLNR, GUIDES, NEEDED
from jflnr.stages import run

CROP = 128
# How often crops of fewer than so many samples per pixel are drawn.
SHARES = {4: 0.5, 16: 0.25, 1 << 30: 0.25}
# Share of the fits that have occlusion among their guides: files of other programs have none.
OCCLUDED = 0.8
# Squared error as displayed below which a picture is as good as its target.
LEAST_ERROR = 3e-4
# A crop that shows little but sky teaches little.
LEAST_SURFACE, TRIES = 0.3, 5
# Change it when prepared frames become others.
VERSION = 1
NOISY = re.compile(r"indirect_(\d+)(_[a-z])?\.R")
OF_NOISE = ("light", "noisy", "error")


class Example(NamedTuple):
    """One crop under one realisation of the noise.

    albedo: `(H, W, 3)`. target: `(H, W, 3)`, what the light should be, as exposed on the screen.
    exposure: of what is read. error: of the frame before the network, as displayed.
    """

    read: Read
    albedo: Any
    target: Any
    exposure: Any
    error: Any


def prepared(path: Path, folder: Path) -> np.ndarray:
    """A frame under about 20 realisations of its noise, each denoised by adaptive FLR.

    One record in half precision, its fields those of `Example`; made once and kept in `folder`.
    The target is the layer `target`, or else `reference`.
    Raises `ValueError` for a frame that lacks a layer or is too small.
    """
    size, time = path.stat().st_size, path.stat().st_mtime_ns
    key = hashlib.sha256(os.fsencode(f"{VERSION} {path.resolve()} {size} {time}"))
    kept = folder / f"{path.stem}-{key.hexdigest()[:12]}.npy"
    if not kept.exists():
        frame, light = layers(path)
        if min(frame.depth.shape[:2]) < CROP:
            raise ValueError(f"{path}: training needs {CROP} x {CROP} pixels at least")
        folder.mkdir(parents=True, exist_ok=True)
        record = _record(frame, light, np.random.default_rng([*os.fsencode(path.name)]))
        with replacing(kept) as beside, beside.open("wb") as file:
            np.save(file, record)
    return np.load(kept, mmap_mode="r")


def layers(path: Path) -> tuple[Frame, dict[int, list[np.ndarray]]]:
    """The frame, its target as `reference`, and its noisy layers by samples per pixel."""
    channels = exr.read_channels(path)
    layer = lambda name: np.stack([channels[f"{name}.{c}"] for c in "RGB"], -1).astype(np.float32)
    found: dict[int, list[np.ndarray]] = {}
    for name in sorted(channels):
        if match := NOISY.fullmatch(name):
            found.setdefault(int(match[1]), []).append(layer(name[:-2]))
    if not found:
        raise ValueError(f"{path}: no noisy layer indirect_N")
    frame = read_frame(path, next(iter(found)))
    if "target.R" in channels:
        frame = dataclasses.replace(frame, reference=layer("target"))
    if frame.reference is None:
        raise ValueError(f"{path}: needs a layer reference")
    return frame, found


def realisations(
    light: dict[int, list[np.ndarray]], random: np.random.Generator
) -> Iterator[tuple[int, np.ndarray]]:
    """Samples per pixel and noisy light `(H, W, 3)`: layers, their means, and mixtures.

    Pixels have random streams of their own, so an image that takes each pixel from one of several
    is as good a realisation as any of them; without such the network learns the few by heart.
    """
    found = {spp: list(images) for spp, images in light.items()}
    for spp, images in light.items():
        if len(images) > 1:
            found.setdefault(spp * len(images), []).append(np.mean(images, axis=0))
    for spp, images in sorted(found.items()):
        yield from ((spp, image) for image in images)
        if len(images) > 1:
            for _ in images:
                chosen = random.integers(len(images), size=(1, *images[0].shape[:2], 1))
                yield spp, np.take_along_axis(np.stack(images), chosen, axis=0)[0]


def _record(
    frame: Frame, light: dict[int, list[np.ndarray]], random: np.random.Generator
) -> np.ndarray:
    albedo, target = np.asarray(frame.albedo), np.asarray(frame.reference)
    scale = exposure(albedo * target)
    wanted = display(albedo * target, scale)
    fields: dict[str, list[Any]] = {name: [] for name in (*OF_NOISE, "spp", "exposure", "occluded")}
    errors = []
    for spp, noisy in realisations(light, random):
        occluded = frame.ao is not None and random.random() < OCCLUDED
        read, unit = before_network(dataclasses.replace(frame, indirect=noisy), occluded)
        for name in OF_NOISE:
            fields[name].append(getattr(read, name))
        fields["spp"].append(spp)
        fields["exposure"].append(unit * scale)
        fields["occluded"].append(occluded)
        errors.append(np.mean((display(albedo * read.light, unit * scale) - wanted) ** 2))
        if occluded or len(errors) == 1:
            guides = read
    of_all = {name: np.asarray(getattr(guides, name)) for name in ("normal", "depth", "ao", "mask")}
    of_all |= {"albedo": albedo, "target": np.clip(target * scale, 0, BRIGHTEST)}
    groups = np.searchsorted(list(SHARES), fields["spp"], side="right")
    own = [np.mean([e for e, g in zip(errors, groups, strict=True) if g == k]) for k in groups]
    found: dict[str, np.ndarray]
    found = {name: np.asarray(value, np.float16) for name, value in of_all.items()}
    found |= {name: np.asarray(fields[name], np.float16) for name in OF_NOISE}
    found |= {"spp": np.array(fields["spp"]), "occluded": np.array(fields["occluded"])}
    found |= {"exposure": np.array(fields["exposure"], np.float32)}
    found |= {"own": np.maximum(own, LEAST_ERROR).astype(np.float32), "group": groups}
    record = np.zeros(1, [(name, value.dtype, value.shape) for name, value in found.items()])
    for name, value in found.items():
        record[name][0] = value
    return record


def before_network(frame: Frame, occluded: bool = True) -> tuple[Read, float]:
    """What the network reads of a frame, and the unit of its light.

    occluded: with the occlusion that the frame may have.
    """
    names = GUIDES if occluded and frame.ao is not None else NEEDED
    read, unit = jax.tree.map(np.asarray, _before(frame_inputs(frame, names), names))
    return read, float(unit)


@jax.jit(static_argnames="names")
def _before(frame: Frame, names: tuple[str, ...]) -> tuple[Read, jax.Array]:
    method = FLNR(params={})
    images = method.images(frame, names)
    stages = method.stages()[:-2]
    parts, known = run(stages, method, images, method.known(images))
    return flnr.to_read(parts, known), known["mean"] * known["unit"]


def draw(record: np.ndarray, random: np.random.Generator) -> Example:
    """A crop under one realisation, mirrored, transposed and recoloured, its normals turned."""
    groups = record["group"][0]
    shares = np.array(list(SHARES.values()))[groups]
    shares /= np.bincount(groups)[groups]
    chosen = random.choice(len(groups), p=shares / shares.sum())
    height, width = record["mask"].shape[1:3]
    for _ in range(TRIES):
        top, left = random.integers(height - CROP + 1), random.integers(width - CROP + 1)
        place = slice(top, top + CROP), slice(left, left + CROP)
        if np.mean(record["mask"][0][place], dtype=np.float32) > LEAST_SURFACE:
            break
    axes = tuple(axis for axis in (0, 1) if random.random() < 0.5)
    turned, order = random.random() < 0.5, random.permutation(3)
    tint = np.exp(0.15 * random.normal(size=3)).astype(np.float32)
    tint /= tint.mean()
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0].astype(np.float32)

    def cut(name: str) -> np.ndarray:
        image = record[name][0, chosen] if name in OF_NOISE else record[name][0]
        image = np.flip(image[place].astype(np.float32), axes)
        return image.transpose(1, 0, 2) if turned else image

    light, noisy, albedo, target = (
        cut(name)[..., order] for name in ("light", "noisy", "albedo", "target")
    )
    mask = cut("mask")
    ao = cut("ao") if record["occluded"][0, chosen] else mask
    read = Read(
        light * tint, noisy * tint, cut("error"), cut("normal") @ rotation, cut("depth"), ao, mask
    )
    of_frame = record["exposure"][0, chosen], record["own"][0, chosen]
    return Example(read, albedo, target * tint, *of_frame)


def digest(paths: Sequence[Path]) -> str:
    """SHA-256 over names and sizes of the files, in order: what was trained on."""
    text = "\n".join(f"{path.name} {path.stat().st_size}" for path in paths)
    return hashlib.sha256(os.fsencode(text)).hexdigest()
