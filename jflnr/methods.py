"""The methods by name. Nothing here imports JAX, so that a command line can list them at once.

A method is a frozen dataclass, a pytree: its numbers are leaves, its options are static. It says
- `name`, and `backends`, those that it runs on, if not on all;
- `for_frame(inputs, names)`: the method with what it takes from the frame's size filled in, or
  `ValueError` for a frame that it cannot denoise (another set of guides, light of another size);
- `images(frame, names, scene, filters)`: what it reads of the pixels, and `margin`, how many pixels
  those depend on beyond their own;
- `known(images)`: what is known of the whole frame from a sparse grid of its pixels;
- `stages()`: what it does (`jflnr.stages`).

- `features`: the layers that it reads, if they are its own, and `guides`, those of them that are
  guides, if not all are; else users choose guides.

Drivers run any such method: whole, in tiles and over time. In place of stages, one with a history
of its own has `start(frame)` and `step(state, frame)`.
"""

import dataclasses
import importlib
from typing import Any

from jflnr import checks

# Name to the module that has the method, its class, and options that the name stands for.
HOMES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "flr": ("jflnr.regression.flr", "FLR", {}),
    "flr-adaptive": ("jflnr.regression.adaptive", "AdaptiveFLR", {}),
    "picture": ("jflnr.regression.picture", "WholePicture", {}),
    "flnr-picture": ("jflnr.network.picture", "PictureFLNR", {}),
    "flnr-small": ("jflnr.network.flnr", "FLNR", {"size": "small"}),
    "flnr": ("jflnr.network.flnr", "FLNR", {}),
    "bmfr": ("jflnr.bmfr.pipeline", "BMFR", {}),
    "auto": ("jflnr.regression.auto", "Auto", {}),
}
# What denoises a frame if nobody says: pictures of other programs are denoised whole.
DEFAULT, WHOLE = "flr", "picture"
# Those of whole pictures, and those of indirect light, which every frame has.
PICTURES = (WHOLE, "flnr-picture")
METHODS = tuple(name for name in HOMES if name not in PICTURES)
BACKENDS = ("jax", "opencl")
AUTO = "auto"


def default_of(frame: Any) -> str:
    """The name of the method that denoises a frame if nobody says."""
    return DEFAULT if frame.beauty is None else WHOLE


def method_of(method: Any = DEFAULT, **options: Any) -> Any:
    """The method that is meant: one by name or an object, with some of its fields replaced.

    Raises `ValueError` for a name that is none, `TypeError` for an option that it does not have.
    """
    if isinstance(method, str):
        checks.choice("method", method, HOMES)
        home, kind, meant = HOMES[method]
        method = getattr(importlib.import_module(home), kind)(**meant)
    if not hasattr(method, "for_frame") or isinstance(method, type):
        raise TypeError(f"method must be a name or an object such as FLR(); got {method!r}")
    fields = [field.name for field in dataclasses.fields(method) if field.init]
    if unknown := [option for option in options if option not in fields]:
        listed = ", ".join(fields) or "no options"
        raise TypeError(f"method {method.name} has no {unknown[0]}; it has {listed}")
    return dataclasses.replace(method, **options)
