"""devices: list the devices that JAX and OpenCL see.

The first OpenCL device is the one that --backend opencl uses.
"""

import argparse
from typing import Any

from jflnr.cli.common import table, to_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    from jflnr.opencl.devices import NoDevice

    found, missing = _jax(), ""
    try:
        found += _opencl()
    except NoDevice as error:
        missing = str(error)
    if arguments.json:
        print(to_json(found))
        return 0
    columns = ("backend", "device", "kind", "driver")
    print(table([columns, *([row[name] for name in columns] for row in found)], left=4))
    if missing:
        print(missing)
    return 0


def _jax() -> list[dict[str, Any]]:
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


def _opencl() -> list[dict[str, Any]]:
    from jflnr.opencl.devices import all_devices, kind

    return [
        {
            "backend": f"opencl {number}",
            "device": device.name.strip(),
            "kind": kind(device),
            "driver": device.version.strip(),
        }
        for number, device in enumerate(all_devices())
    ]
