"""Which function runs a method on an OpenCL device."""

import functools
from collections.abc import Callable
from typing import Any

from jflnr.images.guides import Filters
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.context import Context
from jflnr.opencl.detail import composed
from jflnr.opencl.edges import filter_layers
from jflnr.opencl.flnr import flnr, picture_light
from jflnr.opencl.flr import flr
from jflnr.opencl.network import correct_picture
from jflnr.opencl.noisy_guides import smooth_guide
from jflnr.opencl.shrink import shrink
from jflnr.stages import Known, Parts, run

# By the method's type.
REGRESSIONS: dict[str, Callable[..., Any]] = {
    "FLR": flr,
    "AdaptiveFLR": flr_adaptive,
    "Auto": flr_adaptive,
    "FLNR": flnr,
    "WholePicture": flr_adaptive,
    "PictureFLNR": picture_light,
}


def filters_on(context: Context) -> Filters:
    """What is done to guides, on the device."""
    filters = smooth_guide, filter_layers, shrink
    return Filters(*(functools.partial(filter, context=context) for filter in filters))


def known_on(context: Context) -> Known:
    """What the composing stages of a method take to be done on the device."""
    correct = functools.partial(correct_picture, context)
    return {"composed": functools.partial(composed, context=context), "corrected": correct}


def regress(
    method: Any, images: Parts, context: Context, out: Any | None = None, **options: Any
) -> Parts:
    """`jflnr.stages.regress` on the device.

    out: where `image` is to be. options: as of `flr`.
    """
    others = ("guides_map", "weight")
    given = {name: images[name] for name in others if images.get(name) is not None} | options
    later = [stage for stage in method.stages() if stage.composes]
    denoised = REGRESSIONS[type(method).__name__]
    given |= {"context": context, "out": None if later else out}
    found = denoised(images["target"], images["guides"], method, **given)
    found = found if isinstance(found, tuple) else (found,)
    parts = dict(zip(("image", "error"), found, strict=False))
    if later:
        found, _ = run(later, method, images | parts, known_on(context))
        parts = {name: found[name] for name in later[-1].names}
    return parts
