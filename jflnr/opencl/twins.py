"""Which function runs a method on an OpenCL device."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from jflnr.opencl.context import Context
from jflnr.stages import Parts, compose

# By the method's type: module, function.
REGRESSIONS = {
    "FLR": ("flr", "flr"),
    "AdaptiveFLR": ("adaptive", "flr_adaptive"),
    "FLNR": ("flnr", "flnr"),
    "WholePicture": ("adaptive", "flr_adaptive"),
}


def regress(
    method: Any,
    images: Parts,
    context: Context,
    composed: bool = True,
    out: Any | None = None,
    **options: Any,
) -> Any:
    """`jflnr.stages.regress` on the device; a picture is composed on the host.

    options: as of `flr`. Returns `(H, W, C)`.
    """
    others = ("guides_map", "weight")
    given = {name: images[name] for name in others if images.get(name) is not None} | options
    later = composed and any(stage.composes for stage in method.stages())
    module, function = REGRESSIONS[type(method).__name__]
    run = getattr(importlib.import_module(f"jflnr.opencl.{module}"), function)
    light = run(
        images["target"],
        images["guides"],
        method,
        context=context,
        out=None if later else out,
        **given,
    )
    if not later:
        return light
    picture = np.asarray(compose(method, images | {"image": light}))
    if out is None:
        return picture
    np.copyto(out, picture, casting="same_kind")
    return out
