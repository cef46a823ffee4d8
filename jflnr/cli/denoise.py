"""denoise: denoise frames, and write the light and the picture as EXR.

Frames of Blender (Cycles), Mitsuba 3 and pbrt-v4 are read as they are; `jflnr info` says how.
Each output holds the picture, put together again with the denoised light, as plain R, G, B (and A
where the input has it), and that light, demodulated, as the layer `indirect`.

OUT is a file when IN is one file and OUT ends with .exr; otherwise it is a folder, and each output
has its input's name. An output that exists is kept, which is no error, unless --overwrite is given.
A frame that fails is reported, and the others are still done.
"""

import argparse
import dataclasses
import json
import sys
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jflnr import layouts
from jflnr.cli.common import INPUT_ERRORS, add_map, guide_names, sentence, to_json
from jflnr.cli.jobs import Job, make_folder, plan
from jflnr.cli.settings import settings_of
from jflnr.cli.summary import remarks, summary

if TYPE_CHECKING:
    from jflnr.frame import Frame


EXAMPLES = """\
  jflnr denoise render.exr -o out/              a file of Blender, Mitsuba 3, pbrt-v4 or our own
  jflnr denoise render.exr -o out/ --direct --png --method flr-adaptive
  jflnr denoise shot/ -o clean/ --channels all  every pass of the input, with the clean ones
  jflnr denoise a.exr -o b.exr --map albedo=diffuse.colour --map depth=Z
  jflnr denoise room.exr -o out/ --reference    metrics before and after
"""

DIRECT = "Direct light is left as it was rendered; --direct denoises it too."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("inputs", metavar="IN", nargs="+", type=Path, help="EXR frames, or folders of them")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="file or folder to write")
    add("--spp", type=int, default=1, metavar="N", help="take the noisy layer indirect_N (1)")
    add_map(parser)
    add("--direct", action="store_true", help="denoise direct light too, where it is told apart")
    add("--method", default="flr", help="flr or flr-adaptive (flr)")
    add("--backend", default="jax", help="what runs it: jax or opencl (jax)")
    add("--guides", type=guide_names, metavar="A,B", help="guides (normal,depth,ao, if present)")
    add("--params", type=Path, metavar="FILE", help="parameters that `jflnr fit` wrote")
    add("--sigma", type=float, help="standard deviation of the window, pixels")
    add("--eps", type=float, help="multiplicative regularisation")
    add("--eps-prime", type=float, help="additive regularisation")
    add("--block", type=int, help="side of the squares of pixels that share one model")
    add("--png", action="store_true", help="also write a tone-mapped preview beside the output")
    add(
        "--channels",
        choices=layouts.CHOICES,
        default="light",
        help="write the picture only, also the denoised light (default), or all of the input too",
    )
    add("--reference", action="store_true", help="print metrics against the layer `reference`")
    add("--overwrite", action="store_true", help="replace outputs that exist")
    add("--json", action="store_true", help="print one JSON list instead of lines")
    add("--profile", action="store_true", help="print the time of every OpenCL kernel")
    level = parser.add_mutually_exclusive_group()
    level.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")
    level.add_argument(
        "-v", "--verbose", action="store_true", help="say what each file was read as"
    )


def run(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    jobs = plan(arguments.inputs, arguments.output)
    settings = settings_of(arguments)
    records = []
    compiled: set[tuple] = set()
    with tqdm(jobs, unit="frame", disable=arguments.quiet or None, leave=False) as bar:
        for job in bar:
            records.append(record := _attempt(job, settings, arguments, compiled))
            for line in remarks(record, arguments.quiet):
                bar.write(line, file=sys.stderr)
            if not arguments.json and "error" not in record:
                bar.write(summary(record, arguments.verbose))
    if arguments.json:
        print(to_json(records))
    return 2 if any("error" in record for record in records) else 0


def _attempt(
    job: Job,
    settings: dict[str, Any],
    arguments: argparse.Namespace,
    compiled: set[tuple],
) -> dict[str, Any]:
    """Denoise one frame and say what became of it; a record that JSON can hold."""
    record = {"input": str(job.source), "output": str(job.target)}
    outputs = [job.target, job.preview] if arguments.png else [job.target]
    kept = [str(path) for path in outputs if path.exists()]
    if kept and not arguments.overwrite:
        return record | {"status": "kept", "kept": kept}
    try:
        return record | {"status": "written"} | _denoise(job, settings, arguments, compiled)
    except INPUT_ERRORS as error:
        text = sentence(error)
        named = any(str(path) in text for path in (job.source, *outputs))
        text = text if named else f"{job.source}: {text}"
        return record | {"status": "failed", "error": text}


def _denoise(
    job: Job,
    settings: dict[str, Any],
    arguments: argparse.Namespace,
    compiled: set[tuple],
) -> dict[str, Any]:
    """Read, denoise, write; `compiled` are the shapes there is a program for, and is added to."""
    from jflnr.denoising import denoise
    from jflnr.frame import frame_of
    from jflnr.metrics import measure

    source = layouts.load(job.source, arguments.spp, dict(arguments.map))
    frame = frame_of(source)
    noisy = _with_direct(frame, job.source) if arguments.direct else frame
    if arguments.reference and frame.reference is None:
        raise ValueError(f"{job.source}: --reference needs a layer reference, and there is none")
    make_folder(job.target)
    shapes = tuple(getattr(image, "shape", None) for image in vars(noisy).values())
    times = [time.perf_counter()]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        # The first frame of a kind is denoised twice, to tell compiling from denoising.
        for _ in range(1 if shapes in compiled else 2):
            light = np.asarray(denoise(noisy, **settings), np.float32)
            times.append(time.perf_counter())
    compiled.add(shapes)
    spp = arguments.spp if layouts.native.spp_present(source.channels) else None
    about = _about(frame, settings, spp)
    indirect = light[..., :3]
    lights = {"indirect": indirect} | ({"direct": light[..., 3:]} if arguments.direct else {})
    _write(job, source, frame, lights, about, arguments)
    # Our own files hold converged direct light; other programs' is as noisy as the rest.
    left = spp is None and frame.direct is not None and not arguments.direct
    record = {
        "width": indirect.shape[1],
        "height": indirect.shape[0],
        "layout": source.layout.program,
        "notes": list(source.layout.notes),
        **about,
        "seconds": times[-1] - times[-2],
        "compile_seconds": times[-2] - times[0],
        "warnings": [
            *{str(warning.message): None for warning in caught},
            *_not_finite(frame),
            *([DIRECT] if left else []),
        ],
    }
    if arguments.profile:
        from jflnr.opencl.context import default_context
        from jflnr.opencl.profile import profile

        rows = profile(default_context(), lambda: denoise(noisy, **settings))
        record["profile"] = [row._asdict() for row in rows]
    if arguments.reference:
        images = {"noisy": frame.indirect, "denoised": indirect}
        record["metrics"] = {name: measure(frame, image) for name, image in images.items()}
    return record


def _with_direct(frame: "Frame", path: Path) -> "Frame":
    """The frame whose light to denoise, (H, W, 6), is the indirect and the direct one."""
    if frame.direct is None:
        raise ValueError(f"{path}: --direct needs a layer of direct light, and there is none")
    light = np.concatenate([frame.indirect, frame.direct], axis=-1)
    return dataclasses.replace(frame, indirect=light)


def _write(
    job: Job,
    source: layouts.Source,
    frame: "Frame",
    lights: dict[str, np.ndarray],
    about: dict[str, Any],
    arguments: argparse.Namespace,
) -> None:
    """Write the preview, if asked for, and the EXR, with the input's header and windows."""
    from jflnr import exr
    from jflnr.cli.preview import write_preview
    from jflnr.frame import composite
    from jflnr.metrics import exposure

    frame = dataclasses.replace(frame, direct=lights.get("direct", frame.direct))
    picture = np.asarray(composite(frame, lights["indirect"]), np.float32)
    if arguments.png:
        # The sky or a lamp in view would darken the room: the brightness is set on reflected light.
        lit = composite(dataclasses.replace(frame, emission=None), lights["indirect"])
        write_preview(job.preview, picture, exposure(np.nan_to_num(lit)))
    mask = None if frame.mask is None else np.asarray(frame.mask)
    channels = layouts.output_channels(source, picture, lights, mask, arguments.channels)
    comments = json.dumps(source.header | {"denoiser": about})
    attributes = source.attributes
    exr.write_channels(job.target, channels, comments, attributes.window, attributes.others)


def _about(frame: "Frame", settings: dict[str, Any], spp: int | None) -> dict[str, Any]:
    """What was done, for the record and for the header of the output."""
    from jflnr.guides import choose

    model = settings.get("parameters")
    names = ("sigma", "eps", "eps_prime") if model else ()
    return {
        "method": settings["method"],
        "backend": settings["backend"],
        "spp": spp,
        "guides": list(choose(frame, settings["guides"])),
        "block": settings["block"],
        **{name: float(getattr(model, name)) for name in names},
    }


def _not_finite(frame: "Frame") -> list[str]:
    from jflnr.frame import not_finite

    if not (counts := not_finite(frame)):
        return []
    listed = ", ".join(f"{count} of {layer}" for layer, count in counts.items())
    return [f"pixels that are NaN or infinite (the fit leaves them out): {listed}"]
