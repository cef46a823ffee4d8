"""One context in many threads, and in a process that was forked."""

import subprocess
import sys

import pytest

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
import os
import numpy as np
import jflnr
from jflnr.opencl import NoDevice, flr
image = np.random.default_rng(0).random((20, 30, 3), np.float32)
parameters = jflnr.FLR(12, 1e-3, 1e-4)
flr(image, image, parameters)
if os.fork() == 0:
    try:
        flr(image, image, parameters)
    except NoDevice as error:
        print(error, flush=True)
    os._exit(0)
os.wait()
"""


def test_a_fork_after_use_is_one_sentence(context: Context) -> None:
    command = [sys.executable, "-W", "ignore", "-c", FORKED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert "start processes with" in done.stdout and not done.stderr
