"""What `jflnr denoise` says of one frame, from the record of it that `--json` prints."""

import re
import sys
from collections import Counter
from typing import Any

from jflnr.cli.common import kept_as_it_is, metrics_table, printable, profile_table, tinted


class Remarks:
    """Lines for stderr. A warning that many frames have, but for its numbers, is told once."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.texts: dict[str, str] = {}
        self.counts = Counter[str]()

    def of(self, record: dict[str, Any]) -> list[str]:
        """What is to be said of a frame."""
        lines = []
        for text in () if self.quiet else record.get("warnings", ()):
            kind = re.sub(r"[\d.,]+", "0", text)
            if not self.counts[kind]:
                lines.append(self._warning(record["input"], text))
            self.texts.setdefault(kind, text)
            self.counts[kind] += 1
        if "error" in record:
            lines.append(f"{tinted('jflnr:', 'red', sys.stderr)} {record['error']}")
        return lines

    def repeated(self) -> list[str]:
        """How many more frames each warning was of."""
        more = {kind: count - 1 for kind, count in self.counts.items() if count > 1}
        return [self._warning(f"{n} more", self.texts[kind]) for kind, n in more.items()]

    def _warning(self, what: str, text: str) -> str:
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
    if verbose:
        guides = ", ".join(record["guides"]) or "none"
        lines = [f"layout: {record['layout']}", f"backend: {record['backend']}"]
        lines += [f"guides: {guides}", *record["notes"]]
        text += "".join(f"\n  {printable(line)}" for line in lines)
    if "plan" in record:
        text += "".join(f"\n  {printable(line)}" for line in record["plan"])
    if "metrics" in record:
        text += "\n" + metrics_table(record["metrics"])
    if "profile" in record:
        text += "\n" + profile_table(record["profile"])
    return text
