"""The contact sheet: pictures of many scenes on one page, their names below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from experiments.rendering.frame import Layers

Picture = NDArray[np.uint8]


def tone_mapped(layers: Layers) -> Picture:
    """The composite of a frame as a display shows it, exposed as DESIGN.md measures."""
    light = layers["albedo"] * (layers["direct"] + layers["reference"])
    exposure = 0.35 / max(float(light[layers["mask"][..., 0] > 0].mean()), 1e-9)
    display = np.clip((light + layers["emission"]) * exposure, 0, 1) ** (1 / 2.2)
    return (display * 255 + 0.5).astype(np.uint8)


def contact_sheet(pictures: Sequence[tuple[str, Picture]], columns: int = 3) -> Image.Image:
    """Pictures of one size in rows, each with its name."""
    height, width = pictures[0][1].shape[:2]
    margin, line = 6, 14
    rows = -(-len(pictures) // columns)
    size = (columns * (width + margin) + margin, rows * (height + margin + line) + margin)
    page = Image.new("RGB", size, (245, 245, 245))
    pen = ImageDraw.Draw(page)
    for i, (name, picture) in enumerate(pictures):
        x = margin + i % columns * (width + margin)
        y = margin + i // columns * (height + margin + line)
        page.paste(Image.fromarray(picture), (x, y))
        pen.text((x + 2, y + height + 1), name, fill=(30, 30, 30))
    return page
