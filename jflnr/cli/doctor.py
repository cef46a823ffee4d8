"""doctor: say what this machine has, what is missing, and how long one frame takes.

Lists versions, the devices that JAX and OpenCL see (the first OpenCL device is the one that
--backend opencl uses), where compiled programs are kept, and denoises the shipped frame.
"""

import argparse
import importlib.util
import os
import platform
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from jflnr.cli.common import table, to_json

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

    found, missing = _jax(), _lacking()
    try:
        found += _opencl()
    except NoDevice as error:
        missing.insert(0, str(error))
    facts = {
        "versions": {"python": platform.python_version()} | _versions(),
        "devices": found,
        "caches": _caches(),
        "frame": [_seconds(name) for name in dict.fromkeys(row["backend"] for row in found)],
        "missing": missing,
    }
    print(to_json(facts) if arguments.json else as_text(facts))
    return 0


def as_text(facts: dict[str, Any]) -> str:
    """The facts for a person."""
    columns = ("backend", "device", "kind", "driver")
    devices = [columns, *([row[name] for name in columns] for row in facts["devices"])]
    caches = [("programs of", "folder", "MB")]
    caches += [(c["backend"], c["folder"], f"{c['bytes'] / 1e6:.1f}") for c in facts["caches"]]
    times = [("the shipped frame", "ms", "the first time, s")]
    times += [
        (row["backend"], f"{1e3 * row['seconds']:.0f}", f"{row['first_seconds']:.1f}")
        for row in facts["frame"]
    ]
    parts = [
        ", ".join(f"{name} {version}" for name, version in facts["versions"].items()),
        table(devices, left=4),
        table(caches, left=2),
        table(times),
        *facts["missing"],
    ]
    return "\n\n".join(parts)


def _versions() -> dict[str, str]:
    there = {each.name: each.version for each in metadata.distributions()}
    return {name: there[name] for name in PACKAGES if name in there}


def _jax() -> list[dict[str, str]]:
    import jax

    return [
        {
            "backend": "jax",
            "device": f"{device.platform}:{device.id}",
            "kind": device.device_kind,
            "driver": f"jax {jax.__version__}",
        }
        for device in jax.devices()
    ]


def _opencl() -> list[dict[str, str]]:
    from jflnr.opencl.devices import all_devices, kind

    return [
        {
            "backend": "opencl",
            "device": f"{number}: {device.name.strip()}",
            "kind": kind(device),
            "driver": device.version.strip(),
        }
        for number, device in enumerate(all_devices())
    ]


def _caches() -> list[dict[str, Any]]:
    """Where compiled programs are kept, and how large that is."""
    from jflnr.opencl import kept

    folders = {"jax": os.environ.get("JAX_COMPILATION_CACHE_DIR"), "opencl": kept.folder()}
    return [
        {
            "backend": name,
            "folder": str(folder),
            "bytes": sum(path.stat().st_size for path in Path(folder).glob("*") if path.is_file()),
        }
        for name, folder in folders.items()
        if folder
    ]


def _lacking() -> list[str]:
    """A line for each module that is not there, with the command that brings it."""
    return [
        f"{use} needs {module}: pip install '{package}'"
        for module, (use, package) in OPTIONAL.items()
        if importlib.util.find_spec(module) is None
    ]


def _seconds(backend: str) -> dict[str, Any]:
    """How long one frame takes by `flr`, and how long the first one did, with all that it loads."""
    from jflnr.denoising import SHIPPED_FRAME, Denoiser
    from jflnr.frame import read_frame

    frame, times = read_frame(SHIPPED_FRAME), [time.perf_counter()]
    denoiser = Denoiser("flr", backend=backend)
    for _ in range(2):
        denoiser(frame)
        times.append(time.perf_counter())
    seconds, first = times[2] - times[1], times[1] - times[0]
    return {"backend": backend, "seconds": seconds, "first_seconds": first}
