"""Programs compiled before they are needed, on all cores: a processor's driver takes one at a time.

    python -m jflnr.opencl.ahead PROGRAMS < PLACES

compiles those of a JSON list, files and their defines, that are at the places in it which the bytes
of a pipe tell, and leaves them where later runs find them.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

from jflnr.cluster import cores
from jflnr.opencl import kept
from jflnr.opencl.context import Context, Program, default_context, source


def compile_ahead(context: Context, call: Callable[[], Any]) -> None:
    """Compile what `call` launches and no earlier run has left on disk, in a process per core.

    On a processor, on the default device; elsewhere nothing is done. `call` launches nothing.
    """
    if not context.on_cpu or kept.folder() is None:
        return
    # It reads what happens to lie in memory; what is wrong with the frame is said in earnest later.
    with context.rehearsed() as programs, contextlib.suppress(Exception):
        call()
    kept_at = [context.place_of(*program) for program in programs]
    missing = [p for p, file in zip(programs, kept_at, strict=True) if file and not file.exists()]
    missing.sort(key=lambda program: len(source(program[0])), reverse=True)
    if (count := min(cores(), len(missing))) < 2:
        return
    context.ahead = True
    # -P: no module of the user's folder takes the place of ours.
    command = [sys.executable, "-P", "-m", __name__, json.dumps(missing)]
    # All read the same pipe, this process too, so each takes the next program when it is done.
    nowhere, (places, told) = subprocess.DEVNULL, os.pipe()
    os.write(told, bytes(range(len(missing))))
    os.close(told)
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, places)
        stack.callback(setattr, context, "ahead", False)
        for _ in range(count - 1):
            process = subprocess.Popen(command, stdin=places, stdout=nowhere, stderr=nowhere)
            stack.enter_context(process)  # waits for its end
        compile_some(context, missing, places)


def compile_some(context: Context, programs: Sequence[Program], places: int) -> None:
    """Compile those whose places this process reads from the pipe before others do."""
    while place := os.read(places, 1):
        context.compile(*programs[place[0]])


if __name__ == "__main__":
    compile_some(default_context(), json.loads(sys.argv[1]), 0)
