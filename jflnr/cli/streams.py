"""What stands for files on the command line of `jflnr denoise`: `-`, and OIDN's three pictures."""

import argparse
import contextlib
import functools
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from jflnr import exr, pfm
from jflnr.files import removed
from jflnr.layouts.override import elsewhere

STREAM = Path("-")
# Layers by the options that Open Image Denoise's command has for them.
OF_OIDN = {"alb": "albedo", "nrm": "normal"}


@contextlib.contextmanager
def as_files(
    arguments: argparse.Namespace,
) -> Iterator[tuple[argparse.Namespace, Callable[[str], str]]]:
    """The arguments, with files as inputs and output; what comes out goes to stdout in the end.

    And a function that puts what the user named in place of these files in a text.
    """
    trio = [arguments.hdr, *(getattr(arguments, option) for option in OF_OIDN)]
    inputs, output, layers = arguments.inputs, arguments.output, arguments.map
    if any(trio):
        if inputs or not all(trio):
            raise ValueError("--hdr, --alb and --nrm are given together, in place of IN")
        named = zip(OF_OIDN.values(), trio[1:], strict=True)
        inputs = trio[:1]
        layers = [*layers, *((name, str(path.absolute())) for name, path in named)]
    if not inputs:
        raise ValueError("IN is missing: EXR frames, folders of them, or - for standard input")
    if STREAM in inputs and len(inputs) > 1:
        raise ValueError("- stands for one frame, without others")
    beside = arguments.png or arguments.jpeg or arguments.explain
    if output == STREAM and (arguments.json or beside):
        raise ValueError("-o - writes one picture to standard output, without --json or a preview")
    if output == STREAM and sys.__stdout__ is None:
        raise ValueError("-o - writes to standard output, which is closed")
    with removed(folder := Path(tempfile.mkdtemp())):
        words: dict[Path, str] = {}
        if inputs == [STREAM]:
            inputs = [_received(folder)]
            # Another file is named as seen from the current folder.
            here = lambda value: os.path.abspath(value) if elsewhere(value, STREAM) else value
            layers = [(name, here(value)) for name, value in layers]
            words[inputs[0]] = "standard input"
        target = folder / "out" / f"stdout{inputs[0].suffix}" if output == STREAM else output
        if output == STREAM:
            words[target] = "standard output"
        changed = {"inputs": inputs, "output": target, "map": layers}
        yield (
            argparse.Namespace(**vars(arguments) | changed),
            lambda text: functools.reduce(lambda t, at: t.replace(str(at), words[at]), words, text),
        )
        if output == STREAM and target.exists():
            try:
                with open(1, "wb", closefd=False) as stdout:
                    stdout.write(target.read_bytes())
            except BrokenPipeError:  # who reads it has enough
                raise
            except OSError as error:
                raise OSError(f"standard output cannot be written: {error.strerror}") from None


def _received(folder: Path) -> Path:
    """Standard input as a file; only the start of what is no picture, which may never end."""
    start = sys.stdin.buffer.read(len(exr.MAGIC))
    path = folder / f"stdin{'.pfm' if start[:2] in pfm.KINDS else '.exr'}"
    with path.open("wb") as file:
        file.write(start)
        if start == exr.MAGIC or pfm.named(path):
            shutil.copyfileobj(sys.stdin.buffer, file)
    return path
