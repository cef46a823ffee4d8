"""Which function runs a method on an OpenCL device."""

from __future__ import annotations

from typing import Any

from jflnr.network.flnr import FLNR
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.context import Context
from jflnr.opencl.flnr import flnr
from jflnr.opencl.flr import flr
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.flr import FLR
from jflnr.stages import Parts

REGRESSIONS: dict[type, Any] = {FLR: flr, AdaptiveFLR: flr_adaptive, FLNR: flnr}


def regress(method: Any, images: Parts, context: Context, **options: Any) -> Any:
    """`jflnr.stages.regress` on the device. images: as the method's `images` makes them.

    options: as of `flr`. Returns `(H, W, C)`.
    """
    given = {name: image for name, image in images.items() if image is not None}
    target, guides = given.pop("target"), given.pop("guides")
    return REGRESSIONS[type(method)](target, guides, method, context=context, **given, **options)
