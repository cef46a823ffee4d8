"""The channels of a denoised file, in the terms of the file it came from."""

import numpy as np

from jflnr.layouts.channels import NATIVE, Layout
from jflnr.layouts.override import BORROWED
from jflnr.layouts.source import Source

CHOICES = ("picture", "light", "all")


def output_channels(
    source: Source,
    picture: np.ndarray,
    light: np.ndarray | None,
    mask: np.ndarray | None = None,
    alpha: np.ndarray | None = None,
    passes: np.ndarray | None = None,
    choice: str = "light",
) -> dict[str, np.ndarray]:
    """What to write, from the picture (H, W, 3) and the denoised indirect light (H, W, 3) or None.

    alpha: (H, W, 1), that of the source if None. passes: (H, W, C), denoised, as `pass_names` names
    them. choice: `picture`, as `R`, `G`, `B` with its alpha; `light`, with the layer `indirect`,
    where that was denoised, 0 where `mask` (H, W, 1) is; `all`, also with every channel of the
    source. Of another program's file, the picture and, where `mask` is 1, the light passes are then
    the denoised ones: the file can stand in for the source, and its passes still sum to its
    picture.
    """
    layout = source.layout
    every = source.channels | _planes(layout.picture[:3], picture)
    channels = every if choice == "all" else {}
    surface = True if mask is None else mask[..., 0] > 0
    if choice == "all" and layout.picture and light is not None:
        for name, plane in _planes(layout.channels.get("indirect", ()), light).items():
            channels[name] = np.where(surface, plane, source.channels[name])
    if choice != "picture" and light is not None:
        for name, plane in _planes(NATIVE["indirect"], light).items():
            channels[name] = np.where(surface, plane, 0)
    if passes is not None and choice != "picture":
        channels |= _planes(pass_names(layout), passes)
        channels.pop("", None)
    channels |= _planes(("R", "G", "B"), picture)
    for name in layout.picture[3:]:
        channels["A"] = source.channels[name] if alpha is None else alpha[..., 0]
        if choice == "all":
            channels[name] = channels["A"]
    return {n: pixels for n, pixels in channels.items() if not n.startswith(BORROWED)}


def pass_names(layout: Layout) -> tuple[str, ...]:
    """The channels of the light passes, of their colours, and of what is emitted and seen of the
    environment; "" for those that are not there."""
    none = ("", "", "")
    passes = [lobe.direct + lobe.indirect for lobe in layout.lobes]
    colours = [lobe.colour for lobe in layout.lobes]
    own = [layout.channels.get(layer, none) for layer in ("emission", "environment")]
    return sum((*passes, *colours, *own), ())


def _planes(names: tuple[str, ...], image: np.ndarray) -> dict[str, np.ndarray]:
    return {name: image[..., i] for i, name in enumerate(names)}
