"""What stands for files on the command line of `jflnr denoise`: `-`, and OIDN's three pictures."""

import argparse
import contextlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

STREAM = Path("-")
# Layers by the options that Open Image Denoise's command has for them.
OF_OIDN = {"alb": "albedo", "nrm": "normal"}


@contextlib.contextmanager
def as_files(arguments: argparse.Namespace) -> Iterator[argparse.Namespace]:
    """The arguments, with files as inputs and output; what comes out goes to stdout in the end."""
    trio = [arguments.hdr, *(getattr(arguments, option) for option in OF_OIDN)]
    inputs, output, layers = arguments.inputs, arguments.output, arguments.map
    if any(trio):
        if inputs or not all(trio):
            raise ValueError("--hdr, --alb and --nrm are given together, in place of IN")
        named = zip(OF_OIDN.values(), trio[1:], strict=True)
        inputs, layers = (
            trio[:1],
            [*layers, *((name, str(path.absolute())) for name, path in named)],
        )
    if not inputs:
        raise ValueError("IN is missing: EXR frames, folders of them, or - for standard input")
    if STREAM in inputs and len(inputs) > 1:
        raise ValueError("- stands for one frame, without others")
    if output == STREAM and (arguments.json or arguments.png or arguments.explain):
        raise ValueError("-o - writes one picture to standard output, without --json or --png")
    with tempfile.TemporaryDirectory() as folder:
        if inputs == [STREAM]:
            data = sys.stdin.buffer.read()
            inputs = [Path(folder, "stdin.pfm" if data[:2] in (b"PF", b"Pf") else "stdin.exr")]
            inputs[0].write_bytes(data)
        target = Path(folder, "out", f"stdout{inputs[0].suffix}") if output == STREAM else output
        changed = {"inputs": inputs, "output": target, "map": layers}
        yield argparse.Namespace(**vars(arguments) | changed)
        if output == STREAM and target.exists():
            with open(1, "wb", closefd=False) as stdout:
                stdout.write(target.read_bytes())
