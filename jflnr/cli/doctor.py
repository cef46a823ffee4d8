"""doctor: say what this machine has, what is missing, and how long one frame takes.

Lists versions, the devices that JAX and OpenCL see (the first OpenCL device is the one that
--backend opencl uses), where compiled programs are kept, and denoises the shipped frame by `flr`.
"""

import argparse
import importlib.util
import itertools
import os
import platform
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from jflnr.cli.common import table, to_json
from jflnr.denoising import SHIPPED_FRAME, Denoiser
from jflnr.frame import read_frame

EXAMPLES = """\
  jflnr doctor
  jflnr doctor --json > machine.json
"""

PACKAGES = ("jflnr", "jax", "pyopencl", "numpy", "OpenEXR")
# Modules that not everybody needs, what for, and the packages that bring them.
OPTIONAL = {
    "OpenImageIO": ("frames larger than memory", "jflnr[large]"),
    "distributed": ("--cluster", "jflnr[cluster]"),
    "flip_evaluator": ("the metric FLIP", "flip-evaluator"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")


def run(arguments: argparse.Namespace) -> int:
    from jflnr.opencl.devices import NoDevice

    found = list[dict[str, str]]()
    missing = [
        f"{use} needs {module}: pip install '{package}'"
        for module, (use, package) in OPTIONAL.items()
        if importlib.util.find_spec(module) is None
    ]
    try:
        found.extend(_devices())
    except NoDevice as error:
        missing.insert(0, str(error))
    there = {each.name: each.version for each in metadata.distributions()}
    versions = {name: there[name] for name in PACKAGES if name in there}
    facts: dict[str, Any] = {
        "versions": {"python": platform.python_version()} | versions,
        "devices": found,
        "caches": [*_caches()],
        "frame": [_times(name) for name in dict.fromkeys(row["backend"] for row in found)],
        "missing": missing,
    }
    if arguments.json:
        print(to_json(facts))
        return 0
    print(", ".join(f"{name} {version}" for name, version in facts["versions"].items()))
    for rows in (facts["devices"], facts["caches"], facts["frame"]):
        cells = [[*map(str, row.values())] for row in rows]
        print(f"\n{table([list(rows[0]), *cells], left=4)}" if rows else "")
    print("", *missing, sep="\n")
    return 0


def _devices() -> Iterator[dict[str, str]]:
    """What JAX and OpenCL see; ends with `NoDevice` if that is no OpenCL device."""
    import jax

    from jflnr.opencl.devices import all_devices, kind

    for each in jax.devices():
        name, what = f"{each.platform}:{each.id}", each.device_kind
        yield {"backend": "jax", "device": name, "kind": what, "driver": jax.__version__}
    for number, device in enumerate(all_devices()):
        label, driver = f"{number}: {device.name.strip()}", device.version.strip()
        yield {"backend": "opencl", "device": label, "kind": kind(device), "driver": driver}


def _caches() -> Iterator[dict[str, Any]]:
    """Where compiled programs are kept, and how large that is."""
    from jflnr.opencl import kept

    folders = {"jax": os.environ.get("JAX_COMPILATION_CACHE_DIR"), "opencl": kept.folder()}
    for name, folder in folders.items():
        if folder:
            size = sum(path.stat().st_size for path in Path(folder).glob("*") if path.is_file())
            yield {"programs of": name, "folder": str(folder), "bytes": size}


def _times(backend: str) -> dict[str, Any]:
    """How long one frame takes, and how long the first one did, with all that it loads."""
    frame, times = read_frame(SHIPPED_FRAME), [time.perf_counter()]
    denoiser = Denoiser("flr", backend=backend)
    for _ in range(2):
        denoiser(frame)
        times.append(time.perf_counter())
    first, later = (round(1e3 * (b - a), 1) for a, b in itertools.pairwise(times))
    return {"one frame by": backend, "ms": later, "ms of the first": first}
