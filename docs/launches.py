"""What the host code launches, as tables for who writes another host (docs/opencl_engine.md):

python docs/launches.py flr-adaptive 640 360
python docs/launches.py flr-adaptive 640 360 --temporal        a frame with a history
"""

import re
import sys
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from jflnr.frame import Frame
from jflnr.methods import PICTURES, method_of
from jflnr.opencl import temporal
from jflnr.opencl.context import Context, Launch, is_device_array, source
from jflnr.opencl.twins import REGRESSIONS


def launches(name: str, width: int, height: int, over_time: bool = False) -> list[Launch]:
    """What a frame of this size with normal, depth and occlusion takes, driven as a GPU is."""
    context, method = Context(work_group=64), method_of(name)
    context.on_cpu = False
    light, normal, depth, ao, motion = (
        np.ones((height, width, channels), np.float32) for channels in (3, 3, 1, 1, 2)
    )
    seen = {"beauty": light, "seen_albedo": light} if name in PICTURES else {}
    frame = Frame(indirect=light, normal=normal, depth=depth, ao=ao, motion=motion, **seen)
    with context.recorded() as found:
        if over_time:
            state = temporal.start(frame, method, context=context)
            temporal.step(state, frame, method, context=context)
        else:
            run = REGRESSIONS[type(method).__name__]
            run(light, (normal, depth, ao), method, context=context)
    return found


def tables(found: Sequence[Launch]) -> str:
    """The launches in Markdown, the defines that most share, and how much memory they take."""
    counts = Counter(item for launch in found for item in launch.defines.items())
    usual = dict(item for item, _ in reversed(counts.most_common()))
    flags: dict[str, set[str]] = {}
    for launch in found:
        flags.setdefault(launch.file, set()).update(launch.defines)
    buffers: dict[int, int] = {}
    rows = ["| kernel | file | work-items | own defines | arguments |", "| --- " * 5 + "|"]
    for launch in found:
        own: dict[str, Any] = dict(launch.defines.items() - usual.items())
        own |= dict.fromkeys(flags[launch.file] - launch.defines.keys(), "none")
        pairs = zip(parameters(launch), launch.arguments, strict=False)
        arguments = ", ".join(f"{name} {_shown(value, buffers)}" for name, value in pairs)
        size = " x ".join(map(str, launch.size))
        rows.append(
            f"| `{launch.kernel}` | {launch.file} | {size} | {_listed(own)} | {arguments} |"
        )
    arrays = {id(a): a.nbytes for launch in found for a in launch.arguments if is_device_array(a)}
    memory = f"{len(arrays)} buffers, {sum(arrays.values()) / 1e6:.1f} MB with the images."
    return "\n".join([*rows, "", f"Defines besides: {_listed(usual)}. {memory}"])


def parameters(launch: Launch) -> list[str]:
    """The names of a kernel's parameters, which macros may stand for."""
    text = source(launch.file).replace("\\\n", " ")
    macros = dict(re.findall(r"^#define (\w+_PARAMETERS) *(.+)$", text, re.MULTILINE))
    (listed,) = re.findall(rf"kernel void {launch.kernel}\s*\((.*?)\)", text, re.DOTALL)
    while "_PARAMETERS" in listed:
        listed = re.sub(r"\w+_PARAMETERS", lambda name: macros[name[0]], listed)
    return [parameter.split()[-1].strip("*") for parameter in listed.split(",")]


def _shown(value: Any, buffers: dict[int, int]) -> str:
    """A number, or which buffer and of which shape."""
    if value is None:
        return "NULL"
    if not is_device_array(value):
        return f"{value:.6g}"
    number = buffers.setdefault(id(value), len(buffers))
    return f"b{number} ({', '.join(map(str, value.shape))})"


def _listed(defines: dict[str, Any]) -> str:
    return " ".join(f"{name}={value}" for name, value in sorted(defines.items()))


if __name__ == "__main__":
    name, width, height, *options = sys.argv[1:]
    print(tables(launches(name, int(width), int(height), "--temporal" in options)))
