"""A sequence, denoised by several methods, in motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from experiments import shots
from experiments.temporal_metrics import sequence_exposure
from jflnr.files import replacing
from jflnr.metrics import display

SHOT = "sponza_camera"
PANELS = ("noisy", "flnr", "BMFR", "flnr, temporal")
CROP = (slice(20, 164), slice(40, 296))
MILLISECONDS = 120


def draw(folder: Path) -> None:
    """sequences.gif: crops, two by two: noisy, frame by frame, and with a history."""
    shot = shots.load(SHOT)
    methods = {method.name: method.run for method in shots.methods()}
    methods["noisy"] = lambda frames: [np.asarray(frame.indirect) for frame in frames]
    scale = sequence_exposure(shot.frames)
    panels = []
    for name in PANELS:
        lights = methods[name](shot.frames)
        pairs = zip(shot.frames, lights, strict=True)
        shown = [display(np.asarray(frame.albedo * light), scale) for frame, light in pairs]
        panels.append([labelled(picture[CROP], name) for picture in shown])
    a, b, c, d = (np.stack(panel) for panel in panels)
    pictures = np.concatenate([np.concatenate([a, b], 2), np.concatenate([c, d], 2)], 1)
    save(folder / "sequences.gif", [Image.fromarray(picture) for picture in pictures])


def labelled(picture: np.ndarray, text: str) -> np.ndarray:
    """A picture of values in [0, 1] as bytes, with a word in its corner."""
    image = Image.fromarray(np.uint8(np.round(255 * picture)))
    draw = ImageDraw.Draw(image)
    draw.text((5, 4), text, fill="white", stroke_width=2, stroke_fill="black")
    return np.asarray(image)


def save(path: Path, pictures: list[Image.Image]) -> None:
    """An endless GIF. One palette for all frames, or colours would flicker that do not."""
    palette = pictures[-1].quantize(128)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    first, *rest = frames
    with replacing(path) as beside:
        first.save(beside, save_all=True, append_images=rest, duration=MILLISECONDS, loop=0)
