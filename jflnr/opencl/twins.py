"""Which function runs a method on an OpenCL device."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from jflnr.images.noisy_guides import Filters
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.context import Context
from jflnr.opencl.edges import average
from jflnr.opencl.flnr import flnr
from jflnr.opencl.flr import flr
from jflnr.opencl.noisy_guides import smooth_guide
from jflnr.stages import Parts, compose

# By the method's type.
REGRESSIONS: dict[str, Callable[..., Any]] = {
    "FLR": flr,
    "AdaptiveFLR": flr_adaptive,
    "FLNR": flnr,
    "WholePicture": flr_adaptive,
}


def filters_on(context: Context) -> Filters:
    """What takes the noise from guides, on the device."""
    here = (functools.partial(filter, context=context) for filter in (smooth_guide, average))
    return Filters(*here)


def regress(
    method: Any,
    images: Parts,
    context: Context,
    composed: bool = True,
    out: Any | None = None,
    **options: Any,
) -> Any:
    """`jflnr.stages.regress` on the device.

    options: as of `flr`. Returns `(H, W, C)`.
    """
    others = ("guides_map", "weight")
    given = {name: images[name] for name in others if images.get(name) is not None} | options
    later = composed and any(stage.composes for stage in method.stages())
    run = REGRESSIONS[type(method).__name__]
    given |= {"context": context, "out": None if later else out}
    light = run(images["target"], images["guides"], method, **given)
    if not later:
        return light
    picture = compose(method, images | {"image": light}, {"average": filters_on(context).average})
    if out is None:
        return picture
    np.copyto(out, np.asarray(picture), casting="same_kind")
    return out
