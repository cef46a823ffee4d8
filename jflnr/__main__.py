"""The command `jflnr`, and what ends it soon after Ctrl-C, whatever it is doing."""

import contextlib
import gc
import os
import signal
import sys
import threading
import time
from types import FrameType
from typing import Any, NoReturn

# How long the main thread may take to stop by itself, in seconds.
PATIENCE = 1.0
INTERRUPTED = 130
# Of Ctrl-C, of who runs programs for others, and of a terminal that is closed.
ENDING = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
# Bytes of compiled programs that are kept; the oldest go first.
PROGRAMS = 1 << 28
# An option of XLA with which it compiles in two thirds of the time, and the first version that may
# lack it: of one that it does not know it dies.
QUICK, TRIED = "--xla_cpu_use_fusion_emitters=false", (0, 11)
# Objects between looks for garbage: imports and traces of JAX make hundreds of thousands that stay,
# and looking through them every 700 takes a tenth of a second run's time.
OBJECTS = 100_000


def main() -> int:
    """Run the process's own command line and return its exit code."""
    _open_streams()
    _watch()
    _keep_programs()
    gc.set_threshold(OBJECTS)
    try:
        from jflnr.cli import main as run

        code = run()
    except KeyboardInterrupt:
        _leave()
    if code == INTERRUPTED:  # what still runs may not stand that Python is taken down
        _leave("")
    return code


def _open_streams() -> None:
    """Let streams that are closed go nowhere: a file would take their place, and what is said."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
            setattr(sys, name, open(number, "w" if number else "r", closefd=False))


def _keep_programs() -> None:
    """Let JAX compile quickly, and keep it for later runs, unless its own variables say otherwise.

    Half a minute becomes a few seconds. What XLA says of each program it loads is not for users.
    """
    import platformdirs

    kept = os.path.join(platformdirs.user_cache_dir("jflnr"), "jax")
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", kept)
    os.environ.setdefault("JAX_COMPILATION_CACHE_MAX_SIZE", str(PROGRAMS))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    os.environ.setdefault("XLA_FLAGS", quickly())


def quickly() -> str:
    """The option with which this machine's XLA compiles in less time, or none."""
    from importlib.metadata import version

    return QUICK if tuple(map(int, version("jaxlib").split(".")[:2])) < TRIED else ""


def _watch() -> None:
    """Tell a thread of signals: a compiler keeps the main one from them, and may swallow them."""
    for number in ENDING:
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _interrupt)  # otherwise it is not to be interrupted
    sys.unraisablehook = _swallowed
    if sys.platform != "win32":  # where only a socket can be told
        listening, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        threading.Thread(target=_end, args=(listening,), daemon=True).start()


def _interrupt(_: int, frame: FrameType | None) -> None:
    """An exception, but for modules half imported: some turn it into another one, or crash."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            _leave()
        frame = frame.f_back
    raise KeyboardInterrupt


def _swallowed(unraisable: Any) -> None:
    """Let Ctrl-C end the process also where Python drops exceptions, as in garbage collection."""
    if unraisable.exc_type is KeyboardInterrupt:
        _leave()
    sys.__unraisablehook__(unraisable)


def _end(listening: int) -> None:
    """Once there was such a signal, end the process if it does not end by itself."""
    while os.read(listening, 1)[0] not in ENDING:
        pass
    time.sleep(PATIENCE)
    _leave()


def _leave(words: str = "jflnr: interrupted; no partial file is left\n") -> NoReturn:
    """End the process at once, without a partial file."""
    files: Any = sys.modules.get("jflnr.files")
    for path in list(getattr(files, "unfinished", ())):
        files.remove(path)
    with contextlib.suppress(OSError):  # the terminal may be gone
        os.write(2, words.encode())
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
