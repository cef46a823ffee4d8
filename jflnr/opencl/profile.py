"""Where the time goes: every kernel's share, next to what the device's memory can do."""

from collections.abc import Callable
from typing import Any, NamedTuple

from jflnr.opencl.context import Context

COPIED = 64 << 20  # bytes read and as many written by the copy kernel: more than caches hold


class Row(NamedTuple):
    """One kernel: its best time, what it must at least read and write, and its share of that rate.

    ms: milliseconds. bytes: of all arrays it was given, each once. share: of the copy kernel's
    bytes per second, in the same run.
    """

    kernel: str
    ms: float
    bytes: int
    share: float


def profile(context: Context, work: Callable[[], Any], repeats: int = 10) -> list[Row]:
    """The kernels that `work()` launches on `context`, a copy kernel, and the sum of the former.

    Each kernel's time is its smallest of `repeats` runs, from OpenCL's own clock.
    """
    work()  # compiles
    runs = [_launches(context, work) for _ in range(repeats)]
    best = {name: min(run[name] for run in runs) for name in runs[0]}
    copy_ms, copied = best.pop("copy")
    rate = copied / copy_ms
    total = sum(ms for ms, _ in best.values()), sum(moved for _, moved in best.values())
    rows = {**best, "all kernels": total, "copy": (copy_ms, copied)}
    return [Row(name, ms, moved, moved / ms / rate) for name, (ms, moved) in rows.items()]


def _launches(context: Context, work: Callable[[], Any]) -> dict[str, tuple[float, int]]:
    """Milliseconds and bytes by kernel of one run of `work` and of the copy kernel."""
    with context.recorded() as launches:
        work()
        copied, width = [context.empty((COPIED // 4,)) for _ in range(2)], context.width()
        size, arguments = (COPIED // 4 // width,), (COPIED // 4, *copied)
        context.run("copy", "copy.cl", {"WIDTH": width}, size, arguments)
        context.queue.finish()
    summed: dict[str, tuple[float, int]] = {}
    for launch in launches:
        ms, moved = summed.get(launch.kernel, (0.0, 0))
        span = (launch.event.profile.end - launch.event.profile.start) / 1e6
        summed[launch.kernel] = ms + span, moved + launch.bytes
    return summed
