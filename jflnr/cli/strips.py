"""A frame of `jflnr denoise` that is too large for memory: in strips, from file to file."""

import argparse
import contextlib
import dataclasses
import json
import time
import warnings
from typing import Any

import numpy as np

import jflnr
from jflnr import exr, layouts
from jflnr.cli.content import Pixels, about_of, picture_of, split, spp_of, warnings_of, with_direct
from jflnr.cli.jobs import Job
from jflnr.frame import Frame, frame_of
from jflnr.images.inputs import warn_without_ao
from jflnr.large.scanlines import Scanlines
from jflnr.large.source import Rows

# What the picture is put together from, and what the regression always reads.
PICTURE = {"albedo", "direct", "emission", "mask"}
ALWAYS = {"indirect", "normal", "depth", "mask"}


def denoise_in_strips(
    job: Job, denoiser: "jflnr.Denoiser", arguments: argparse.Namespace, tile: int
) -> dict[str, Any]:
    """Read, denoise and write a frame piece by piece; the record of it."""
    _check(arguments)
    start = time.perf_counter()
    file = Scanlines(job.source, arguments.spp, dict(arguments.map))
    first = file.part(0, 1, layouts.LAYERS)
    whole = frame_of(first)  # but for its size
    settings = {"method": denoiser.method, "backend": denoiser.backend, "guides": denoiser.guides}
    about = about_of(whole, settings, spp_of(first, arguments))
    comments = json.dumps(first.header | {"denoiser": about})
    size, window = (file.height, file.width), file.attributes.window
    others = file.attributes.others
    pixels = Pixels()
    with contextlib.ExitStack() as stack:
        caught = stack.enter_context(warnings.catch_warnings(record=True))
        warnings.simplefilter("always", UserWarning)
        warn_without_ao(whole, denoiser.guides, denoiser.method)
        append, names = None, tuple(about["guides"])
        rows = _rows(file, names, arguments)
        for top, given in denoiser.strips(rows, names, tile, job.target.parent):
            channels = _channels(file, top, given["image"], arguments, names, pixels)
            if "error" in given:
                channels["error.Y"] = given["error"][..., 0]
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
        "warnings": warnings_of(caught, pixels, about, whole, arguments),
    }


def _check(arguments: argparse.Namespace) -> None:
    for option in ("png", "reference", "profile"):
        if getattr(arguments, option):
            raise ValueError(f"--{option} needs the whole frame in memory: raise --memory")
    if arguments.channels == "all":
        raise ValueError("--channels all needs the whole frame in memory: raise --memory")


def _rows(file: Scanlines, names: tuple[str, ...], arguments: argparse.Namespace) -> Rows:
    """What the denoiser reads."""
    layers = ALWAYS | set(names) | ({"direct"} if arguments.direct else set())
    rows = file.rows(layers)
    if not arguments.direct:
        return rows

    def read(start: int, stop: int) -> Frame:
        both = with_direct(rows.read(start, stop), file.path)
        return dataclasses.replace(both, direct=None)

    return dataclasses.replace(rows, read=read)


def _channels(
    file: Scanlines,
    top: int,
    light: np.ndarray,
    arguments: argparse.Namespace,
    guides: tuple[str, ...],
    pixels: Pixels,
) -> dict[str, np.ndarray]:
    """What to write of a strip, whose pixels are counted."""
    part = file.part(top, top + light.shape[0], PICTURE.union(guides))
    frame, lights = frame_of(part), split(light)
    pixels.add(frame)
    picture = picture_of(frame, lights)
    mask = None if frame.mask is None else np.asarray(frame.mask)
    return layouts.output_channels(part, picture, lights, mask, arguments.channels)
