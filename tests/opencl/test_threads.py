"""One context in many threads, and in a process that was forked."""

import subprocess
import sys
from pathlib import Path

import pytest

import jflnr
from experiments import threads
from jflnr.opencl import Context


@pytest.mark.parametrize(
    ("method", "backend", "brightness"),
    [
        *((method, "opencl", 1) for method in threads.METHODS),
        ("flr-adaptive", "opencl", 1e20),
        ("flr", "jax", 1),
        ("bmfr", "jax", 1),
    ],
)
def test_threads_get_what_one_gets(
    context: Context, method: str, backend: str, brightness: float
) -> None:
    frames = threads.made_up(3, brightness)
    assert threads.differing(frames, method, backend, 60) == 0


FORKED = """
import os, sys
import jflnr
from experiments.threads import made_up
from jflnr.cli import main
(frame,) = made_up(1)
jflnr.write_frame(sys.argv[2] + "/frame.exr", frame)
command = ["denoise", sys.argv[2] + "/frame.exr", "-o", sys.argv[2] + "/out.exr", "--backend"]
denoise = {
    "function": lambda frame: jflnr.flr(frame.indirect, frame.normal),
    "jax": jflnr.Denoiser("flr"),
    "opencl": jflnr.Denoiser("flr", backend="opencl"),
    "command": lambda frame: print(main([*command, "jax", "--overwrite"])),
}[sys.argv[1]]
denoise(frame)
if os.fork() == 0:
    try:
        denoise(frame)
    except ImportError as error:
        print(error, flush=True)
    os._exit(0)
os.wait()
"""


@pytest.mark.parametrize("used", [*jflnr.BACKENDS, "function", "command"])
def test_a_fork_after_use_is_one_sentence(context: Context, used: str, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "ignore", "-c", FORKED, used, str(tmp_path)]
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60
    )
    assert "start processes with" in done.stdout and "Traceback" not in done.stdout
