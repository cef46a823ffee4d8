"""FLNR on an OpenCL device: the steps of jflnr/network/flnr.py (docs/flnr.md)."""

import dataclasses
from typing import Any

from jflnr.checks import one_sentence
from jflnr.network.flnr import DEFAULT, FLNR
from jflnr.network.picture import PictureFLNR
from jflnr.opencl import network
from jflnr.opencl.adaptive import flr_adaptive, write_light
from jflnr.opencl.arguments import run_on_images
from jflnr.opencl.context import Context
from jflnr.opencl.energy import rescale
from jflnr.opencl.grids import Images
from jflnr.regression.arguments import channel_count


@one_sentence()
def flnr(target: Any, guides: Any, method: FLNR = DEFAULT, **options: Any) -> Any:
    """`jflnr.flnr` on an OpenCL device; all else as of `flr_adaptive` of `adaptive.py`."""
    return run_on_images(write, target, guides, method, **options)


def write(context: Context, images: Images, method: FLNR, output: Any, error: Any) -> None:
    """Write the corrected light, `(H, W, C)`, with about the brightness of the input, and, if that
    is not None, its error."""
    method = method.ready(channel_count(images[1]), output.shape[2])
    light, image = context.empty(output.shape), context.empty(output.shape)
    noise = context.empty((*output.shape[:2], 1)) if error is None else error
    run = write_light(context, images, method, light, noise)
    network.correct(context, method.params, images, light, noise, run.mean, image)
    slack = 0.0 if method.keep_energy else float(method.slack)
    rescale(context, image, images, output, slack)


def picture_light(target: Any, guides: Any, method: PictureFLNR, **options: Any) -> tuple[Any, Any]:
    """The light of a picture before the network, and its error; all else as of `flr_adaptive`."""
    return flr_adaptive(target, guides, dataclasses.replace(method, with_error=True), **options)
