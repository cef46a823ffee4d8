"""Which function runs a method on an OpenCL device."""

from __future__ import annotations

import importlib
from typing import Any

from jflnr.opencl.context import Context
from jflnr.stages import Parts

# By the method's type: module, function.
REGRESSIONS = {
    "FLR": ("flr", "flr"),
    "AdaptiveFLR": ("adaptive", "flr_adaptive"),
    "FLNR": ("flnr", "flnr"),
}


def regress(method: Any, images: Parts, context: Context, **options: Any) -> Any:
    """`jflnr.stages.regress` on the device. images: as the method's `images` makes them.

    options: as of `flr`. Returns `(H, W, C)`.
    """
    given = {name: image for name, image in images.items() if image is not None}
    target, guides = given.pop("target"), given.pop("guides")
    module, function = REGRESSIONS[type(method).__name__]
    run = getattr(importlib.import_module(f"jflnr.opencl.{module}"), function)
    return run(target, guides, method, context=context, **given, **options)
