"""The OpenCL devices of this machine, and the choice of one."""

import os
from types import ModuleType
from typing import Any

from jflnr.lazy import check_not_forked

ADVICE = (
    "install an OpenCL driver, or PoCL, which runs on the processor: pip install 'jflnr[opencl]'"
)
KINDS = ("GPU", "ACCELERATOR", "CPU", "CUSTOM")


class NoDevice(ImportError):
    """There is no OpenCL device, or no pyopencl, here, or this process cannot use it."""


def pyopencl() -> ModuleType:
    """The module, or `NoDevice` that says how to get it."""
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")  # drivers have a cache of their own
    # PoCL would compile each kernel for its size of work-group, and for any size to keep it: the
    # latter is as fast.
    os.environ.setdefault("POCL_WORK_GROUP_SPECIALIZATION", "0")
    try:
        import pyopencl
        import pyopencl.array
        import pyopencl.tools
    except ImportError as error:
        raise NoDevice(f"The opencl backend needs pyopencl ({error}); {ADVICE}") from None
    check_not_forked("OpenCL", NoDevice)
    return pyopencl


def all_devices() -> list[Any]:
    """All devices, best kind first, as `pyopencl.Device`; `NoDevice` if there is none."""
    cl = pyopencl()
    try:
        found = [device for platform in cl.get_platforms() for device in platform.get_devices()]
    except cl.Error:
        found = []  # the loader's way to say that no driver is installed
    if not found:
        raise NoDevice(f"No OpenCL device was found; {ADVICE}")
    return sorted(found, key=lambda device: KINDS.index(kind(device)))


def kind(device: Any) -> str:
    """One of `KINDS`."""
    types = pyopencl().device_type
    return next((name for name in KINDS if device.type & getattr(types, name)), "CUSTOM")


def choose(name: str | int | None = None) -> Any:
    """A device by its number in `all_devices()` or a part of its name; by default the best.

    Raises `ValueError` if there is none of that name, `NoDevice` if there is none at all.
    """
    found = all_devices()
    if name is None:
        return found[0]
    for number, device in enumerate(found):
        label = f"{device.platform.name} {device.name}"
        wanted = str(name).lower()
        if wanted == str(number) or (not wanted.isdigit() and wanted in label.lower()):
            return device
    listed = ", ".join(f"{i}: {device.name.strip()}" for i, device in enumerate(found))
    raise ValueError(f"There is no OpenCL device {name!r}; there are {listed}")
