"""The command as a new user meets it: every picture in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments import results, whole
from jflnr import exr
from jflnr.denoising import SHIPPED_FRAME
from jflnr.frame import read_frame, write_frame

NAME = "first_picture"
QUESTION = "How long does the first picture take?"
MINUTES = 8

SIZE = 360, 640
REPEATS = 5
# Method and back end; the whole picture has 13 guides, the others 5.
RUNS = (
    ("flr", "opencl"),
    ("flr-adaptive", "opencl"),
    ("picture", "opencl"),
    ("flr-adaptive", "jax"),
)
# Prints the seconds that gradients of a method take to compile.
GRADIENTS = """
import dataclasses
import sys
import time
import jax
import jax.numpy as jnp
import jflnr
frame = jflnr.read_frame(sys.argv[2]).map(lambda image: image[:128, :160])

def error(light, normal, depth, ao):
    seen = frame.map(jnp.asarray)
    seen = dataclasses.replace(seen, indirect=light, normal=normal, depth=depth, ao=ao)
    return jnp.mean((jflnr.denoise(seen, sys.argv[1]) - frame.reference) ** 2)

images = frame.indirect, frame.normal, frame.depth, frame.ao
traced = jax.jit(jax.grad(error, (0, 1, 2, 3))).trace(*images)
start = time.perf_counter()
traced.lower().compile()
print(time.perf_counter() - start)
"""
# What a command of Open Image Denoise does: from file to file.
OIDN = """
import sys
import jflnr
from jflnr import exr
from experiments.peers import oidn
from experiments.whole import auxiliaries
frame = jflnr.read_frame(sys.argv[1])
image = oidn.layers(color=frame.beauty, **auxiliaries(frame))
exr.write_channels(sys.argv[2], {c: image[..., i] for i, c in enumerate("RGB")})
"""


def run(quick: bool) -> dict[str, Any]:
    """Seconds of the whole command: where nothing is kept yet, and the best of later runs."""
    with tempfile.TemporaryDirectory() as folder:
        frame, picture, out = (str(Path(folder, f"{name}.exr")) for name in ("ours", "it", "out"))
        write_frame(frame, whole.repeated(read_frame(SHIPPED_FRAME), *SIZE))
        rows = []
        for method, backend in RUNS[:1] if quick else RUNS:
            source = frame if method != "picture" else _picture(picture)
            command = ["-m", "jflnr", "denoise", source, "-o", out, "--overwrite", "--quiet"]
            command += ["--method", method, "--backend", backend]
            kept = Path(folder, f"{method}-{backend}")
            rows.append({"method": method, "backend": backend} | _times(command, kept, quick))
        if not quick:
            command = ["-c", OIDN, _picture(picture), out]
            rows.append({"method": "OIDN", "backend": "its own"} | _times(command, kept, quick))
    methods = ("flr",) if quick else ("flr", "flr-adaptive")
    return {"seconds": rows, "gradients": [{"method": m, "seconds": gradients(m)} for m in methods]}


def gradients(method: str) -> float:
    """Seconds to compile the gradient by light and guides, of 160 x 128 pixels."""
    command = [sys.executable, "-c", GRADIENTS, method, str(SHIPPED_FRAME)]
    streams: dict[str, Any] = {"capture_output": True, "text": True}
    done = subprocess.run(command, env=_variables(), cwd=results.ROOT, check=True, **streams)
    return float(done.stdout)


def _variables() -> dict[str, str]:
    """Those of this process that do not tell JAX where programs are kept."""
    return {name: value for name, value in os.environ.items() if name[:4] not in ("JAX_", "TF_C")}


def _picture(path: str) -> str:
    """A picture of Cycles, repeated to `SIZE`."""
    source, (height, width) = whole.folders()[0] / "4spp.exr", SIZE
    channels, attributes = exr.read_channels(source), exr.read_attributes(source)
    down, across = (-(-n // m) for n, m in zip(SIZE, attributes.size, strict=True))
    large = {name: np.tile(x, (down, across))[:height, :width] for name, x in channels.items()}
    exr.write_channels(path, large, others=attributes.others)
    return path


def _times(command: Sequence[str], kept: Path, quick: bool) -> dict[str, float]:
    """kept: a new folder for all that programs keep."""
    kept.mkdir(exist_ok=True)
    own = _variables() | dict.fromkeys(("HOME", "XDG_CACHE_HOME", "POCL_CACHE_DIR"), str(kept))
    seconds = []
    for _ in range(2 if quick else 1 + REPEATS):
        start = time.perf_counter()
        subprocess.run([sys.executable, *command], env=own, cwd=results.ROOT, check=True)
        seconds.append(time.perf_counter() - start)
    return {"first run": seconds[0], "later run": min(seconds[1:])}
