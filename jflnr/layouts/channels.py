"""Layers, the channels they are made of, and reading one out of the other."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from jflnr.exr import layer_of, layers_of

# The layers of a Frame, with the components that our own files give them.
LAYERS = {
    "indirect": "RGB",
    "albedo": "RGB",
    "normal": "XYZ",
    "depth": "Z",
    "position": "XYZ",
    "ao": "Y",
    "mask": "Y",
    "emission": "RGB",
    "direct": "RGB",
    "reference": "RGB",
    "reference_a": "RGB",
    "motion": "XY",
}
NATIVE = {layer: tuple(f"{layer}.{c}" for c in parts) for layer, parts in LAYERS.items()}
# What a Frame holds besides of another program's picture, noisy as it is.
PICTURE = {
    "beauty": "RGB",
    "alpha": "A",
    "emitted": "RGB",
    "environment": "RGB",
    "seen_albedo": "RGB",
    "seen_normal": "XYZ",
    "lobes": "",
    "lobe_colours": "",
    "samples": "N",
}

# Every half number as float32, by its bits: numpy converts slower than it looks up.
HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)

# In the order of both `R G B` and `X Y Z`.
ORDER = "RXUGYVBZT"
WORDS = {"red": "R", "green": "G", "blue": "B"}


class Lobe(NamedTuple):
    """What one kind of surface does with light: channels of its colour, and of direct and indirect
    light divided by that. "" stands for a colour of 1, and for light that is not there."""

    colour: tuple[str, ...]
    direct: tuple[str, ...]
    indirect: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """What a file's channels mean.

    `channels` maps layers of a Frame to channel names; `emission` are those of light that surfaces
    emit, and one more, `radiance`, is light to be denoised that is still multiplied by albedo (the
    beauty where there is neither `radiance` nor `indirect`).
    """

    program: str
    channels: Mapping[str, tuple[str, ...]]
    picture: tuple[str, ...] = ()  # where the program keeps the picture: R, G, B and maybe alpha
    notes: tuple[str, ...] = ()  # what a user should know about it
    advice: Mapping[str, str] = field(default_factory=dict)  # how to have a missing layer written
    motion_up: bool = False  # motion counts upwards; in a Frame it counts downwards, as rows do
    lobes: tuple[Lobe, ...] = ()  # the light passes that the picture is the sum of

    @property
    def light(self) -> str:
        """The layer that is denoised: `indirect`, `radiance` or `beauty`."""
        return next(n for n in ("indirect", "radiance", "beauty") if n in self.channels)


def in_layer(channels: Iterable[str], layer: str) -> tuple[str, ...]:
    """The colour or vector channels of `layer`, in order, without alpha.

    Where there are three colours, another channel beside them (`R G B A Z`) is not of the layer.
    """
    own = {_letter(name): name for name in channels if layer_of(name) == layer}
    kept = "RGB" if set("RGB") <= set(own) else ORDER
    return tuple(own[letter] for letter in kept if letter in own)


def _letter(channel: str) -> str:
    """`R` for `albedo.R`, `albedo.r` and `albedo.red`."""
    component = channel.rpartition(".")[2]
    return WORDS.get(component.lower(), component.upper())


def layer(
    channels: Mapping[str, np.ndarray],
    name: str,
    names: tuple[str, ...],
    source: str,
    advice: str = "",
    part: bool = False,
) -> np.ndarray:
    """Layer `name` of a Frame, float32 (H, W, C), from the channels `names`.

    Three channels make a layer of one by their mean, one makes a layer of three by repetition; an
    albedo may be the sum of several.
    Raises ValueError, naming `source`, if channels are missing or no value is finite; `advice`
    says what to do about a missing layer. part: of the image, which may well be all sky.
    """
    stem = layer_of(names[0]) or ", ".join(names)
    missing = [channel for channel in names if channel not in channels]
    if missing == list(names):
        raise ValueError(f"{source}: layer {stem} is missing; {advice or present(channels)}")
    if missing:
        raise ValueError(f"{source}: layer {stem} lacks its channel {', '.join(missing)}")
    image = np.stack([channels[channel] for channel in names], axis=-1)
    half = image.dtype == np.float16
    image = HALVES.take(image.view(np.uint16)) if half else image.astype(np.float32)
    if not part and not any(np.isfinite(row).any() for row in image):
        raise ValueError(f"{source}: layer {stem} is NaN or infinite everywhere")
    count = len((LAYERS | PICTURE).get(name, "RGB"))
    if name == "seen_albedo" and len(names) % 3 == 0:
        return image.reshape(*image.shape[:2], -1, 3).sum(axis=2)
    if count != 1 and len(names) not in (1, count):
        raise ValueError(f"{source}: layer {stem} has {len(names)} channels instead of {count}")
    if count == 1 < len(names):
        return image.mean(axis=-1, keepdims=True)
    return np.repeat(image, count, axis=-1) if len(names) == 1 < count else image


def present(channels: Iterable[str]) -> str:
    """What there is, for an error's reader."""
    layers = layers_of(channels)
    return "the file holds " + ", ".join(n or "plain " + "".join(c) for n, c in layers.items())
