"""denoise: denoise frames, and write the light and the picture as EXR.

Frames of Blender (Cycles), Mitsuba 3 and pbrt-v4 are read as they are; `jflnr info` says how. Of
them the whole picture is denoised, of our own, and by any method but `picture`, diffuse indirect
light. Each output holds the picture as plain R, G, B (and A where the input has it), and indirect
light that was denoised, demodulated, as the layer `indirect`.

OUT is a file when IN is one file and OUT ends with .exr or .pfm; otherwise it is a folder, and each
output has its input's name; - is standard input or output. An output that exists is kept, which is
no error, unless --overwrite is given. Of a frame that fails it is said why, the others are still
done, and the exit code is 3.

With --temporal a folder is a shot: its frames are denoised in the order of their numbers, each with
what the ones before it left.
"""

import argparse
import dataclasses
import errno
import functools
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import TextIO

from jflnr import cluster, layouts
from jflnr.cli import shots, streams
from jflnr.cli.common import COLOUR, SOME_FAILED, add_map, guide_names, tinted, to_json, voices
from jflnr.cli.frames import Record, Worker, failure
from jflnr.cli.jobs import Job, borrowed, check_apart, pipelined, plan
from jflnr.cli.settings import settings_of
from jflnr.cli.summary import remarks, repeated, summary, throughput
from jflnr.large import memory
from jflnr.methods import AUTO, BACKENDS, DEFAULT, HOMES, WHOLE

EXAMPLES = """\
  jflnr denoise render.exr -o out/              a file of Blender, Mitsuba 3, pbrt-v4 or our own
  jflnr denoise render.exr -o out/ --method flr-adaptive        its diffuse indirect light only
  jflnr denoise shot/ -o clean/ --temporal --method flr-adaptive      a film, without flicker
  jflnr denoise shot/ -o clean/ --channels all  every pass of the input, with clean light passes
  jflnr denoise room.exr -o out/ --method auto --explain    where each frame is refined
  jflnr denoise a.exr -o b.exr --map albedo=diffuse.colour --map depth=Z
  jflnr denoise room.exr -o out/ --reference    metrics before and after
  jflnr denoise --hdr color.pfm --alb albedo.pfm --nrm normal.pfm -o out.pfm    as OIDN's command
"""

WITHOUT_WAITING = getattr(os, "O_NONBLOCK", 0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    flag = functools.partial(add, action="store_true")
    add("inputs", metavar="IN", nargs="*", type=Path, help="EXR frames, or folders of them, or -")
    for option, layer in {"hdr": "picture", **streams.OF_OIDN}.items():
        add(f"--{option}", metavar="FILE", type=Path, help=f"the {layer}, PFM or EXR, as of OIDN")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="file or folder to write")
    add("--spp", type=int, default=1, metavar="N", help="take the noisy layer indirect_N (1)")
    add_map(parser)
    listed = ", ".join(HOMES)
    usual = f"{WHOLE} for other programs' files, {DEFAULT} for our own"
    add("--method", choices=HOMES, metavar="M", help=f"{listed} ({usual})")
    plan_of = "with --method auto: print how much it refines, and write a map, OUT.plan.png"
    flag("--explain", help=plan_of)
    add("--worth", type=float, help="with auto: least share of signal to refine a tile for (0.6)")
    auto = "what runs it; auto takes opencl where it can (auto)"
    add("--backend", default=AUTO, choices=(AUTO, *BACKENDS), help=auto)
    add("--guides", type=guide_names, metavar="A,B", help="guides (normal,depth,ao, if present)")
    add("--params", type=Path, metavar="FILE", help="what `jflnr fit` or `train` wrote")
    add("--sigma", type=float, help="standard deviation of the window, pixels")
    add("--eps", type=float, help="multiplicative regularisation")
    add("--eps-prime", type=float, help="additive regularisation")
    add("--block", type=int, help="side of the squares of pixels that share one model")
    told = "with flr-adaptive, picture and flnr...: add the standard error as the layer `error`"
    flag("--error-map", help=told)
    flag("--lobes", help="with picture: clean every light pass too")
    flag("--temporal", help="use the frames before: a folder is a shot")
    kept = "keep there what the next frame needs, for a later run to go on from (--temporal)"
    add("--history", type=Path, metavar="FILE", help=kept)
    flag("--png", help="also write a tone-mapped preview beside the output")
    flag("--jpeg", help="the same in JPEG")
    written = "write the picture only, also the denoised light (default), or all of the input too"
    add("--channels", choices=layouts.CHOICES, default="light", help=written)
    flag("--reference", help="print metrics against the layer `reference`")
    least = "a frame of less PSNR fails (--reference)"
    add("--fail-below", type=decibels, metavar="DB", help=least)
    flag("--overwrite", help="replace outputs that exist")
    flag("--json", help="print one JSON list instead of lines")
    add("--log", type=Path, metavar="FILE", help="add what is said to FILE, with the time")
    flag("--profile", help="print the time of every OpenCL kernel")
    add("--memory", metavar="SIZE", help="denoise in pieces what takes more, as 4G (half the free)")
    where = "denoise on a Dask cluster, tcp://HOST:8786; without ADDRESS on this machine's cores"
    add("--cluster", nargs="?", const="", metavar="ADDRESS", help=where)
    level = parser.add_mutually_exclusive_group().add_argument
    level("-q", "--quiet", action="store_true", help="print nothing but errors")
    level("-v", "--verbose", action="store_true", help="say what each file was read as")


def decibels(text: str) -> float:
    """A number, of decibels."""
    if math.isfinite(found := float(text)):
        return found
    raise ValueError


def run(arguments: argparse.Namespace) -> int:
    with streams.as_files(arguments) as (of_files, named):
        return _run(of_files, named, arguments.output == streams.STREAM)


def _run(arguments: argparse.Namespace, named: Callable[[str], str], piped: bool) -> int:
    """named: puts what the user named into a text. piped: whether stdout is for the picture."""
    from tqdm import tqdm

    jobs = plan(arguments.inputs, arguments.output)
    outputs = [path for job in jobs for path in job.files]
    sources, others = [job.source for job in jobs], [arguments.history, arguments.log]
    check_apart(others, [*outputs, *sources])
    check_apart([arguments.log], [arguments.history])
    check_apart([*outputs, *others], [arguments.params, *borrowed(arguments.map, sources)])
    bound = memory.parse(arguments.memory) if arguments.memory else None
    if len(jobs) > 1 and bound is None:
        memory.keep_freed()
    worker = Worker(settings_of(arguments), arguments, bound, min(len(jobs), 3))
    records, told, start = [], Counter[str](), time.perf_counter()
    with (
        voices() as (out, err),
        open(arguments.log or os.devnull, "ab", buffering=0, opener=_at_once) as log,
        tqdm(
            total=len(jobs), unit="frame", disable=arguments.quiet or None, leave=False, file=err
        ) as bar,
    ):

        def say(line: str, stream: TextIO | None) -> None:
            line = named(line)
            if stream is not None:
                bar.write(line, file=stream)
            plain = f"{datetime.now().isoformat(' ', 'seconds')} {COLOUR.sub('', line)}\n"
            try:
                log.write(plain.encode(errors="backslashreplace"))
            except OSError as error:
                raise OSError(f"{arguments.log} cannot be written: {error.strerror}") from None

        loud = None if arguments.quiet else err
        results = None if arguments.json else loud if piped else out
        for record in _records(worker, jobs, arguments):
            records.append(record)
            bar.update()
            for line in remarks(record, told):
                say(line, loud)
            if "error" in record:
                say(f"{tinted('jflnr:', 'red', sys.stderr)} {record['error']}", err)
            else:
                say(summary(record, arguments.verbose), results)
        for line in repeated(told):
            say(line, loud)
        if arguments.verbose and arguments.cluster is None:
            seconds = time.perf_counter() - start
            say(throughput(records, worker.exr_seconds, seconds), err)
    if arguments.json:
        places = {str(job.source): place for place, job in enumerate(jobs)}
        print(named(to_json(sorted(records, key=lambda record: places[record["input"]]))))
    good = sum("error" not in record for record in records)
    return 0 if good == len(records) else SOME_FAILED if good else 2


def _at_once(path: str, flags: int) -> int:
    """Open without waiting for who reads a pipe."""
    try:
        handle = os.open(path, flags | WITHOUT_WAITING, 0o666)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise OSError(f"{path} cannot be written: nobody reads this pipe") from None
    if WITHOUT_WAITING:
        os.set_blocking(handle, True)
    return handle


def _records(worker: Worker, jobs: list[Job], arguments: argparse.Namespace) -> Iterator[Record]:
    """What becomes of the frames, in the order in which they are finished."""
    if arguments.cluster is not None:
        # Workers on this machine share its memory.
        at_once = 1 if arguments.cluster else cluster.cores()
        worker = dataclasses.replace(worker, at_once=at_once, compiled=None)
    if shots.wanted(arguments):
        return shots.records(worker, jobs, arguments)
    if arguments.cluster is None:
        return pipelined(jobs, worker.read, worker.denoise, worker.write)
    return cluster.each(arguments.cluster, worker, jobs, failure)
