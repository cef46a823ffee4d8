"""One frame of `jflnr denoise` in three stages: read, denoise, write."""

import argparse
import contextlib
import functools
import json
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

import jflnr
from jflnr import exr, layouts
from jflnr.cli.common import INPUT_ERRORS, printable, sentence
from jflnr.cli.compiling import compiling_is_told
from jflnr.cli.content import Pixels, Result, about_of, channels_of, result_of, warnings_of
from jflnr.cli.jobs import Job, make_folder
from jflnr.frame import Frame, frame_of
from jflnr.large import memory
from jflnr.methods import DEFAULT, PICTURES, WHOLE, method_of
from jflnr.metrics import exposure, measure

# Pixels on each side of what needs the same programs as a frame.
CORNER = 64
# What became of a frame, as JSON can hold it.
Record = dict[str, Any]
# What a denoiser gives, by name: `image`, and what else was asked for.
Given = dict[str, np.ndarray]


class Loaded(NamedTuple):
    """A frame that was read, or that is to be read in pieces; `tile`: what it is denoised in."""

    job: Job
    source: layouts.Source | None = None
    frame: Frame | None = None
    tile: int | None = None


class Denoised(NamedTuple):
    """A frame, and what became of it."""

    job: Job
    source: layouts.Source
    frame: Frame
    result: Result
    about: dict[str, Any]
    record: Record


def stage(work: Callable[..., Any]) -> Callable[..., Any]:
    """A stage of `Worker`. It returns a record where nothing is left to do, as the frame is there,
    has failed or is written; later stages pass that on."""

    @functools.wraps(work)
    def run(worker: "Worker", given: Any, *more: Any) -> Any:
        if isinstance(given, dict):
            return given
        try:
            with np.errstate(all="ignore"):  # of any numbers in a file; what counts is said
                return work(worker, given, *more)
        except INPUT_ERRORS as error:
            return failure(given if isinstance(given, Job) else given.job, error)

    return run


@dataclass
class Worker:
    """Denoises files. Calling it does all of a frame's stages; threads may share them.

    settings: keyword arguments of `jflnr.Denoiser`. arguments: of the command line. memory: bytes
    that frames may take, None for a share of what is free. at_once: how many may be in memory.
    compiled: shapes of the frames that there are programs for, None if nobody asks.
    """

    settings: dict[str, Any]
    arguments: argparse.Namespace
    memory: int | None
    at_once: int = 1
    compiled: set[tuple] | None = field(default_factory=set)
    exr_seconds: dict[str, float] = field(default_factory=lambda: {"read": 0.0, "write": 0.0})

    @functools.cached_property
    def denoiser(self) -> jflnr.Denoiser:
        """What denoises; made where it is used, since it does not travel to another process."""
        return self._another()

    def _another(self, **options: Any) -> jflnr.Denoiser:
        return jflnr.Denoiser(**self.settings | options)

    def denoiser_for(self, frame: Frame, tile: int | None) -> jflnr.Denoiser:
        """The one for a frame, which also cleans light passes if they are asked for."""
        whole = self.denoiser.method_for(frame).name in PICTURES
        if self.arguments.lobes and not whole:
            raise ValueError("--lobes is for pictures of other programs and --method picture")
        asked = self.arguments.lobes or (
            self.arguments.channels == "all" and frame.lobes is not None
        )
        if not (whole and asked) and tile is None:
            return self.denoiser
        lobes = {"lobes": True, "method": self.settings["method"] or WHOLE}
        return self._another(tile=tile, **(lobes if whole and asked else {}))

    def __call__(self, job: Job) -> Record:
        return self.write(self.denoise(self.read(job)))

    def read(self, job: Job) -> Loaded | Record:
        """The frame in memory, or only how large its pieces are to be."""
        return self.kept(job) or self.load(job)

    def kept(self, job: Job) -> Record | None:
        """The record of a frame of which all is there that was asked for."""
        beside = job.previews | {"explain": job.explanation}
        asked = vars(self.arguments)
        outputs = [job.target, *(path for option, path in beside.items() if asked[option])]
        if self.arguments.overwrite or not all(path.exists() for path in outputs):
            return None
        return _record(job) | {"status": "kept", "kept": [str(path) for path in outputs]}

    @stage
    def load(self, job: Job) -> Loaded | Record:
        """As `read`, also of a frame whose output is there."""
        start = time.perf_counter()
        attributes, method = exr.read_attributes(job.source), self.settings["method"]
        make_folder(job.target)
        bound = self.memory or memory.free()
        if method is None:
            other = layouts.is_picture(attributes.names) or "beauty" in dict(self.arguments.map)
            method = method_of(WHOLE if other else DEFAULT)
        tile = memory.tile_for(*attributes.size, bound, self.at_once, method)
        if tile is not None and not memory.holds(*attributes.size, bound, self.at_once):
            return Loaded(job, tile=tile)
        source = layouts.load(job.source, self.arguments.spp, dict(self.arguments.map))
        self.exr_seconds["read"] += time.perf_counter() - start
        # On a device, what does not work in tiles is tried whole.
        tile = None if self.settings["backend"] == "opencl" else tile
        return Loaded(job, source, frame_of(source), tile)

    @stage
    def denoise(
        self, loaded: Loaded, instead: Callable[[Frame], Given] | None = None
    ) -> Denoised | Record:
        """instead: what denoises in place of the denoiser; it may be called twice."""
        job, source, frame, tile = loaded
        arguments = self.arguments
        if source is None or frame is None:
            from jflnr.cli.strips import denoise_in_strips

            assert tile is not None
            return _record(job) | denoise_in_strips(job, self._another(tile=tile), arguments, tile)
        denoiser = self.denoiser_for(frame, tile)
        denoise_frame = instead or functools.partial(_given, denoiser)
        method = denoiser.method_for(frame)
        measured = arguments.reference or arguments.fail_below is not None
        if measured and frame.reference is None:
            raise ValueError(
                f"{job.source}: --reference needs a layer reference: of a whole picture --map "
                "reference=FILE, another picture"
            )
        shapes = tuple((name, image.shape) for name, image in frame.layers().items())
        times = [time.perf_counter()]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            if self.compiled is not None and shapes not in self.compiled:
                with compiling_is_told(denoiser, method.name, arguments.quiet):
                    _make_ready(denoiser, frame, denoise_frame)
                times.append(time.perf_counter())
            given = denoise_frame(frame)
            times.append(time.perf_counter())
        if self.compiled is not None:
            self.compiled.add(shapes)
        about = about_of(frame, denoiser, source, arguments)
        result = result_of(frame, method, given)
        pixels = Pixels()
        pixels.add(frame, method, result.picture)
        record = {
            "width": result.picture.shape[1],
            "height": result.picture.shape[0],
            "layout": source.layout.program,
            "notes": list(source.layout.notes),
            **about,
            "seconds": times[-1] - times[-2],
            "compile_seconds": times[-2] - times[0],
            "warnings": warnings_of(caught, pixels),
        }
        if arguments.profile:
            from jflnr.opencl.context import default_context
            from jflnr.opencl.profile import profile

            rows = profile(default_context(), lambda: denoise_frame(frame))
            record["profile"] = [row._asdict() for row in rows]
        if arguments.explain:
            from jflnr.cli.pictures import explain

            record["plan"] = explain(job.explanation, frame, method, denoiser.guides)
        if measured:
            images = {"noisy": frame.indirect, "denoised": result.light}
            if frame.beauty is not None:
                images = {"noisy": frame.beauty, "denoised": result.picture}
            record["metrics"] = {name: measure(frame, np.asarray(i)) for name, i in images.items()}
            psnr, least = record["metrics"]["denoised"]["psnr"], arguments.fail_below
            if least is not None and not psnr >= least:
                raise ValueError(f"{job.source}: its PSNR of {psnr:.2f} dB is below {least:g}")
        return Denoised(job, source, frame, result, about, record)

    @stage
    def write(self, done: Denoised) -> Record:
        """Write what is not there: the EXR, with the input's header and window, the preview."""
        from jflnr.cli.pictures import write_preview

        start, arguments = time.perf_counter(), self.arguments
        job, source, frame, result, about, record = done
        missing = lambda path: arguments.overwrite or not path.exists()
        if missing(job.target):
            channels = channels_of(source, frame, result, arguments)
            comments = json.dumps(source.header | {"denoiser": about})
            window, others = source.attributes.window, source.attributes.others
            exr.write_channels(job.target, channels, comments, window, others)
        for option, preview in job.previews.items():
            if getattr(arguments, option) and missing(preview):
                # The sky or a lamp in view would darken the room: what is lit sets the brightness.
                write_preview(preview, result.picture, exposure(np.nan_to_num(result.lit)))
        self.exr_seconds["write"] += time.perf_counter() - start
        return _record(job) | {"status": "written"} | record


def _given(denoiser: jflnr.Denoiser, frame: Frame) -> Given:
    given = denoiser(frame)
    if not isinstance(given, tuple):
        return {"image": given}
    names = denoiser.method_for(frame).stages()[-1].names
    return dict(zip(names, given, strict=True))


def _make_ready(
    denoiser: jflnr.Denoiser, frame: Frame, denoise_frame: Callable[[Frame], Given]
) -> None:
    """Have all programs for frames like this one, so that compiling is told from denoising."""
    if denoiser.backend == "jax":  # whose programs are for one size
        denoise_frame(frame)
        return
    from jflnr.opencl.ahead import compile_ahead

    call = lambda: denoise_frame(frame.map(lambda image: image[:CORNER, :CORNER].copy()))
    # What is wrong with the frame is said when all of it is denoised.
    with warnings.catch_warnings(action="ignore"), contextlib.suppress(Exception):
        compile_ahead(denoiser.context, call)
        call()


def failure(job: Job, error: BaseException) -> Record:
    """The record of a frame that failed."""
    text = sentence(error)
    named = any(printable(path) in text for path in (job.source, *job.files))
    text = text if named else f"{printable(job.source)}: {text}"
    return _record(job) | {"status": "failed", "error": text}


def _record(job: Job) -> Record:
    return {"input": str(job.source), "output": str(job.target)}
