"""What `jflnr denoise` says of one frame, from the record of it that `--json` prints."""

import re
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any

from jflnr.cli.common import kept_as_it_is, metrics_table, printable, profile_table, tinted


def remarks(record: dict[str, Any], told: Counter[str]) -> Iterator[str]:
    """Warnings of one frame that are new. told: how often each has come, whatever its numbers."""
    for text in record.get("warnings", ()):
        told[kind := re.sub(r"[\d.,]*\d", "N", text)] += 1
        if told[kind] == 1:
            yield _warning(record["input"], text)


def repeated(told: Counter[str]) -> Iterator[str]:
    """How many more frames each warning was of."""
    yield from (_warning(f"{n - 1} more", kind) for kind, n in told.items() if n > 1)


def _warning(what: str, text: str) -> str:
    warning = tinted("warning:", "yellow", sys.stderr)
    return f"jflnr: {warning} {printable(what)}: {printable(text)}"


def throughput(records: list[dict[str, Any]], exr: dict[str, float], seconds: float) -> str:
    """Frames per second, and how long files kept a thread busy. exr: seconds by `read`, `write`."""
    done = sum(record["status"] == "written" for record in records)
    shares = ", ".join(f"{verb} EXR {spent / seconds:.0%}" for verb, spent in exr.items())
    return f"{done} written in {seconds:.1f} s, {done / seconds:.2f} a second; {shares} of the time"


def summary(record: dict[str, Any], verbose: bool) -> str:
    """Lines for stdout."""
    if record["status"] == "kept":
        return kept_as_it_is(*record["kept"])
    source = record["layout"] if record["spp"] is None else f"{record['spp']} spp"
    text = (
        f"{printable(record['input'])} -> {printable(record['output'])}  "
        f"{record['width']} x {record['height']}, {source}, {record['method']}, "
        f"{record['seconds']:.2f} s"
    )
    if record["compile_seconds"]:
        text += f" (and {record['compile_seconds']:.1f} s to compile)"
    lines = record.get("plan", [])
    if verbose:
        guides = ", ".join(record["guides"]) or "none"
        read = [f"layout: {record['layout']}", f"backend: {record['backend']}", f"guides: {guides}"]
        lines = [*read, *record["notes"], *lines]
    text += "".join(f"\n  {printable(line)}" for line in lines)
    if "metrics" in record:
        text += "\n" + metrics_table(record["metrics"])
    if "profile" in record:
        text += "\n" + profile_table(record["profile"])
    return text
