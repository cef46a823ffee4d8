"""Chooses Mitsuba's variant: a GPU where there is one, else LLVM, else the slow scalar one."""

from __future__ import annotations

import ctypes.util
import glob
import os
import warnings
from functools import cache

OLDEST_LLVM = 16  # 14 and 15 abort the whole process
FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/local/lib",
    "/opt/*/lib",
)


def find_llvm() -> str | None:
    """The path of the newest libLLVM that Mitsuba can use, or None."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        return named if os.path.exists(named) else None
    for version in range(30, OLDEST_LLVM - 1, -1):
        names = (f"libLLVM-{version}.so*", f"libLLVM.so.{version}*")
        found = [p for d in FOLDERS for n in names for p in sorted(glob.glob(f"{d}/{n}"))]
        library = ctypes.util.find_library(f"LLVM-{version}")
        if found or library:
            return found[0] if found else library
    return None


def _has_gpu() -> bool:
    return bool(glob.glob("/dev/nvidia[0-9]*")) and ctypes.util.find_library("cuda") is not None


@cache
def start(threads: int | None = None, variant: str | None = None) -> str:
    """Set Mitsuba's variant once for this process; returns its name.

    `threads` bounds the CPU threads. Raises ValueError where Mitsuba is not installed.
    """
    llvm = find_llvm()
    if llvm:
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm  # read by Dr.Jit when it is loaded
    try:
        import drjit as dr
        import mitsuba as mi
    except ImportError as error:
        raise ValueError(
            "the renderer needs Mitsuba 3: install it with `pip install mitsuba`"
        ) from error
    chosen = variant or ("cuda_ad_rgb" if _has_gpu() else "llvm_ad_rgb" if llvm else "scalar_rgb")
    if chosen == "scalar_rgb" and variant is None:
        warnings.warn(
            f"no GPU and no libLLVM of version {OLDEST_LLVM} or later was found (Debian: libllvm19,"
            " or name one in DRJIT_LIBLLVM_PATH): scalar_rgb renders about 1000 times slower",
            stacklevel=2,
        )
    if threads:
        dr.set_thread_count(threads)
    mi.set_variant(chosen)
    return chosen
