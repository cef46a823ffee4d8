"""What is said of programs that are compiled, which takes long once."""

import contextlib
import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from jflnr.denoising import Denoiser
from jflnr.files import json_object, write_atomically

# Seconds that it may take without a word.
SILENCE = 1.0
# Events of JAX: a program is wanted, was found on disk, is there.
WANTED = "/jax/compilation_cache/compile_requests_use_cache"
DONE = "/jax/core/compile/backend_compile_duration"


@contextlib.contextmanager
def compiling_is_told(denoiser: Denoiser, method: str, quiet: bool) -> Iterator[None]:
    """Say on stderr what takes so long, if that is to compile, and how long it took before."""
    from tqdm import tqdm

    name, start = f"{denoiser.backend} {method}", time.monotonic()
    compiles = _in_jax() if denoiser.backend == "jax" else lambda: denoiser.context.compiles
    done, compiled = threading.Event(), threading.Event()

    def tell() -> None:
        while not done.wait(SILENCE):
            if compiles():
                compiled.set()
                last = _seconds().get(name)
                took = "" if last is None else f" ({last:.0f} s the last time)"
                if not quiet:
                    text = f"jflnr: compiling {method} for this machine, once{took} ..."
                    tqdm.write(text, file=sys.stderr)
                return

    threading.Thread(target=tell, daemon=True).start()
    try:
        yield
    finally:
        done.set()
    if compiled.is_set():
        with contextlib.suppress(OSError):  # a disk that is full or not to be written
            seconds = _seconds() | {name: time.monotonic() - start}
            write_atomically(_place(), json.dumps(seconds).encode())


def _in_jax() -> Callable[[], bool]:
    """Whether JAX has been at one program for half of `SILENCE`."""
    from jax import monitoring

    since: list[float] = []

    def wanted(event: str, **_: Any) -> None:
        if event == WANTED:
            since[:] = [time.monotonic()]

    def ended(event: str, duration_secs: float, **_: Any) -> None:
        if event == DONE:
            since.clear()

    monitoring.register_event_listener(wanted)
    monitoring.register_event_duration_secs_listener(ended)
    return lambda: any(time.monotonic() - t > SILENCE / 2 for t in since[:1])


def _place() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("jflnr", ensure_exists=True), "compiling.json")


def _seconds() -> dict[str, Any]:
    """How long each method took to compile, by back end and name."""
    try:
        found = json_object(_place().read_bytes())
    except OSError:
        return {}
    return {name: s for name, s in found.items() if isinstance(s, int | float)}
