"""A frame of `jflnr denoise` that is too large for memory: in strips, from file to file."""

import argparse
import contextlib
import json
import time
import warnings
from typing import Any

import numpy as np

import jflnr
from jflnr import exr, layouts, pfm
from jflnr.cli.common import refuse
from jflnr.cli.content import Pixels, about_of, channels_of, result_of, warnings_of
from jflnr.cli.jobs import Job
from jflnr.frame import frame_of
from jflnr.images.inputs import names_of, warn_without_ao
from jflnr.large.scanlines import Scanlines

# What the picture is put together from, and what the regression always reads.
PICTURE = {"albedo", "direct", "emission", "mask"}
ALWAYS = {"indirect", "normal", "depth", "mask"}


def denoise_in_strips(
    job: Job, denoiser: "jflnr.Denoiser", arguments: argparse.Namespace, tile: int
) -> dict[str, Any]:
    """Read, denoise and write a frame piece by piece; the record of it."""
    whole_only = ("png", "jpeg", "explain", "reference", "fail_below", "profile", "lobes")
    refuse(arguments, whole_only, "needs the whole frame in memory: raise --memory")
    if arguments.channels == "all":
        raise ValueError("--channels all needs the whole frame in memory: raise --memory")
    if pfm.named(job.source) or pfm.named(job.target):
        raise ValueError("PFM needs the whole frame in memory: raise --memory")
    start = time.perf_counter()
    file = Scanlines(job.source, arguments.spp, dict(arguments.map))
    first = file.part(0, 1, (*layouts.LAYERS, *layouts.PICTURE))
    whole = frame_of(first)  # but for its size
    method = denoiser.method_for(whole)
    about = about_of(whole, denoiser, first, arguments)
    comments = json.dumps(first.header | {"denoiser": about})
    size, window = (file.height, file.width), file.attributes.window
    others = file.attributes.others
    pixels = Pixels()
    with contextlib.ExitStack() as stack:
        caught = stack.enter_context(warnings.catch_warnings(record=True))
        warnings.simplefilter("always", UserWarning)
        warn_without_ao(whole, denoiser.guides, method)
        append, names = None, names_of(whole, denoiser.guides, method)
        rows = file.rows(ALWAYS | set(names))
        for top, given in denoiser.strips(rows, names, tile, job.target.parent):
            stop = top + given["image"].shape[0]
            part = file.part(top, stop, PICTURE.union(names))
            frame = frame_of(part)
            result = result_of(frame, method, given)
            pixels.add(frame, method, result.picture)
            channels = channels_of(part, frame, result, arguments)
            if append is None:
                types = dict.fromkeys(channels, np.float32)
                output = exr.writing_rows(job.target, size, types, comments, window, others)
                append = stack.enter_context(output)
            append(channels)
    return {
        "status": "written",
        "width": file.width,
        "height": file.height,
        "layout": file.layout.program,
        "notes": [*file.layout.notes, f"in pieces of {tile} x {tile} pixels"],
        **about,
        "seconds": time.perf_counter() - start,
        "compile_seconds": 0,
        "warnings": warnings_of(caught, pixels),
    }
