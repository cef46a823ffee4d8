"""Training examples: crops of frames under ever other noise, with all that precedes the network."""

import dataclasses
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeAlias

import jax
import numpy as np

from jflnr import exr, layouts
from jflnr.files import replacing
from jflnr.frame import Frame, frame_of
from jflnr.images.inputs import frame_inputs, names_of
from jflnr.metrics import display, exposure
from jflnr.network.features import BRIGHTEST
from jflnr.network.flnr import DEFAULT, GUIDES, NEEDED
from jflnr.stages import run

CROP = 128
# Crops of fewer samples per pixel than the first, than the second, and of more are drawn as often.
GROUPS = 4, 16
# Share of the fits that have occlusion among their guides: files of other programs have none.
OCCLUDED = 0.8
# Squared error as displayed below which a picture is as good as its target.
LEAST_ERROR = 3e-4
# A crop that shows little but sky teaches little.
LEAST_SURFACE, TRIES = 0.3, 5
# Change it when prepared frames become others.
VERSION = 3
# A channel of a noisy layer: its samples per pixel, and which of several streams it is of.
NOISY = re.compile(r"(\w+?)_(\d+)(_[a-z])?\.(\w+)")


class Example(NamedTuple):
    """One crop under one realisation of the noise.

    albedo: `(H, W, 3)`, by which the light is multiplied, or `(1, 1, 3)`. target: `(H, W, 3)`, what
    the light should be, as exposed on the screen. exposure: of what is read. error: of the frame
    before the network, as displayed.
    """

    read: Any
    albedo: Any
    target: Any
    exposure: Any
    error: Any


def prepared(path: Path, folder: Path, method: Any = DEFAULT) -> np.ndarray:
    """A frame under about 20 realisations of its noise, each denoised without the network.

    method: `FLNR` or `PictureFLNR`. One record in half precision, its fields those of `Example`;
    made once and kept in `folder`. The target is the layer `target`, or else `reference`.
    Raises `ValueError` for a frame that lacks a layer or is too small.
    """
    size, time = path.stat().st_size, path.stat().st_mtime_ns
    key = hashlib.sha256(
        os.fsencode(f"{VERSION} {method.read.LAYER} {path.resolve()} {size} {time}")
    )
    kept = folder / f"{path.stem}-{key.hexdigest()[:12]}.npy"
    if not kept.exists():
        noisy = Noisy.of(path, method)
        target = noisy.target()
        if min(target.shape[:2]) < CROP:
            raise ValueError(f"{path}: training needs {CROP} x {CROP} pixels at least")
        folder.mkdir(parents=True, exist_ok=True)
        record = _record(noisy, target, np.random.default_rng([*os.fsencode(path.name)]))
        with replacing(kept) as beside, beside.open("wb") as file:
            np.save(file, record)
    return np.load(kept, mmap_mode="r")


Channels: TypeAlias = dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Noisy:
    """A file with several noisy versions of a frame.

    method: whose network is to read it. fixed: its channels without noise. streams: by samples per
    pixel, the noisy ones, all named alike.
    """

    path: Path
    method: Any
    attributes: exr.Attributes
    fixed: Channels
    streams: dict[int, list[Channels]]

    @classmethod
    def of(cls, path: Path, method: Any) -> Self:
        """Raises `ValueError` if there is no noisy layer of what the method denoises."""
        channels, layer = exr.read_channels(path), method.read.LAYER
        found: dict[int, dict[str, Channels]] = {}
        fixed = dict(channels)
        for name in sorted(channels):
            match = NOISY.fullmatch(name)
            if match and f"{layer}_{match[2]}{match[3] or ''}.R" in channels:
                stream = found.setdefault(int(match[2]), {}).setdefault(match[3] or "", {})
                stream[f"{match[1]}_{match[2]}.{match[4]}"] = fixed.pop(name)
        if not found:
            raise ValueError(f"{path}: no noisy layer {layer}_N")
        streams = {spp: [*some.values()] for spp, some in found.items()}
        return cls(path, method, exr.read_attributes(path), fixed, streams)

    def frame(self, spp: int, stream: Channels) -> Frame:
        """The frame under one realisation of the noise."""
        channels = self.fixed | stream
        layout = layouts.source.recognise(channels, spp)
        return frame_of(layouts.Source(self.path, channels, self.attributes, layout))

    def target(self) -> np.ndarray:
        """What the light should be, `(H, W, 3)`. Raises `ValueError` if nothing says so."""
        return self._layer("target" if "target.R" in self.fixed else "reference")

    def albedo(self) -> np.ndarray:
        """What the light is to be multiplied by to be shown, `(H, W, 3)`, or 1 for pictures."""
        if self.method.read.LAYER == "beauty":
            return np.ones((1, 1, 3), np.float32)
        return self._layer("albedo")

    def _layer(self, name: str) -> np.ndarray:
        if f"{name}.R" not in self.fixed:
            raise ValueError(f"{self.path}: needs a layer {name}")
        return np.stack([self.fixed[f"{name}.{c}"] for c in "RGB"], -1).astype(np.float32)

    def realisations(self, random: np.random.Generator) -> Iterator[tuple[int, Frame]]:
        """Samples per pixel, and the frame with a noisy layer, their means, and mixtures.

        Pixels have random streams of their own, so an image that takes each pixel from one of
        several is as good a realisation as any of them; without such the network learns the few by
        heart.
        """
        found = {spp: list(streams) for spp, streams in self.streams.items()}
        for spp, streams in self.streams.items():
            if (count := len(streams)) > 1:
                renamed = lambda name, to=spp * count, spp=spp: name.replace(f"_{spp}.", f"_{to}.")
                mean: Channels = {
                    renamed(name): np.asarray(np.mean([s[name] for s in streams], 0), np.float32)
                    for name in streams[0]
                }
                found.setdefault(spp * count, []).append(mean)
        for spp, streams in sorted(found.items()):
            yield from ((spp, self.frame(spp, stream)) for stream in streams)
            if len(streams) > 1:
                for _ in streams:
                    shape = next(iter(streams[0].values())).shape
                    chosen = random.integers(len(streams), size=shape)
                    pixels = {n: [stream[n] for stream in streams] for n in streams[0]}
                    mixed = {n: np.choose(chosen, some) for n, some in pixels.items()}
                    yield spp, self.frame(spp, mixed)


def _record(noisy: Noisy, target: np.ndarray, random: np.random.Generator) -> np.ndarray:
    read, albedo = noisy.method.read, noisy.albedo()
    scale = exposure(albedo * target)
    wanted = display(albedo * target, scale)
    fields: dict[str, list[Any]] = {name: [] for name in (*read.OF_NOISE, "spp", "exposure")}
    errors, found = [], None
    for spp, frame in noisy.realisations(random):
        occluded = frame.ao is not None and random.random() < OCCLUDED
        found, unit = before_network(frame, noisy.method, occluded)
        for name in read.OF_NOISE:
            fields[name].append(getattr(found, name))
        fields["spp"].append(spp)
        fields["exposure"].append(unit * scale)
        errors.append(np.mean((display(albedo * found.light, unit * scale) - wanted) ** 2))
    still = {name: getattr(found, name) for name in read._fields if name not in read.OF_NOISE}
    still |= {"by": albedo, "target": np.clip(target * scale, 0, BRIGHTEST)}
    half = still | {name: fields[name] for name in read.OF_NOISE}
    groups = np.searchsorted(GROUPS, fields["spp"], side="right")
    own = [np.mean([e for e, g in zip(errors, groups, strict=True) if g == k]) for k in groups]
    images: dict[str, np.ndarray]
    images = {name: np.asarray(value, np.float16) for name, value in half.items()}
    images |= {"spp": np.array(fields["spp"]), "group": groups}
    images |= {"exposure": np.array(fields["exposure"], np.float32)}
    images |= {"before": np.maximum(own, LEAST_ERROR).astype(np.float32)}
    record = np.zeros(1, [(name, value.dtype, value.shape) for name, value in images.items()])
    for name, value in images.items():
        record[name][0] = value
    return record


def before_network(frame: Frame, method: Any = DEFAULT, occluded: bool = True) -> tuple[Any, float]:
    """What the network of a method reads of a frame, and the unit of its light.

    occluded: with the occlusion that the frame may have.
    """
    if hasattr(method, "features"):
        names = names_of(frame, None, method)
    else:
        names = GUIDES if occluded and frame.ao is not None else NEEDED
    read, unit = jax.tree.map(np.asarray, _before(method, frame_inputs(frame, names), names))
    return read, float(unit.flat[0])


@jax.jit(static_argnames="names")
def _before(method: Any, frame: Frame, names: tuple[str, ...]) -> tuple[Any, jax.Array]:
    images = method.images(frame, names)
    parts, known = run(method.before_network(), method, images, method.known(images))
    return method.to_read(images | parts, known)


def draw(method: Any, record: np.ndarray, random: np.random.Generator) -> Example:
    """A crop under one realisation, mirrored, transposed and recoloured, its normals turned.

    method: that the record was prepared for.
    """
    read, of_noise = method.read, method.read.OF_NOISE
    groups = record["group"][0]
    shares = 1 / np.bincount(groups)[groups]
    chosen = random.choice(len(groups), p=shares / shares.sum())
    height, width = record["target"].shape[1:3]

    def image(name: str) -> np.ndarray:
        return record[name][0, chosen] if name in of_noise else record[name][0]

    for _ in range(TRIES):
        top, left = random.integers(height - CROP + 1), random.integers(width - CROP + 1)
        place = slice(top, top + CROP), slice(left, left + CROP)
        if np.mean(image(read.COVER)[place], dtype=np.float32) > LEAST_SURFACE:
            break
    axes = tuple(axis for axis in (0, 1) if random.random() < 0.5)
    turned, order = random.random() < 0.5, random.permutation(3)
    tint = np.exp(0.15 * random.normal(size=3)).astype(np.float32)
    tint /= tint.mean()
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0].astype(np.float32)

    def cut(name: str) -> np.ndarray:
        found = image(name)
        if found.shape[:2] != (1, 1):
            found = found[place]
        found = np.flip(found.astype(np.float32), axes)
        found = found.transpose(1, 0, 2) if turned else found
        if name in read.DIRECTIONS:
            return found @ rotation
        return found[..., order] if name in (*read.COLOURS, "by", "target") else found

    images = {name: cut(name) * (tint if name in read.LIGHT else 1) for name in read._fields}
    of_frame = record["exposure"][0, chosen], record["before"][0, chosen]
    return Example(read(**images), cut("by"), cut("target") * tint, *of_frame)


def digest(paths: Sequence[Path]) -> str:
    """SHA-256 over names and sizes of the files, in order: what was trained on."""
    text = "\n".join(f"{path.name} {path.stat().st_size}" for path in paths)
    return hashlib.sha256(os.fsencode(text)).hexdigest()
