"""The command `jflnr`, and what ends it soon after Ctrl-C, whatever it is doing."""

import os
import signal
import socket
import sys
import threading
import time

# How long the main thread may take to stop by itself, in seconds.
PATIENCE = 1.0
WORDS = "jflnr: interrupted; no partial file is left"


def main() -> int:
    """Run the process's own command line and return its exit code."""
    _open_streams()
    _watch()
    try:
        from jflnr.cli import main as run

        return run()
    except KeyboardInterrupt:  # while importing
        print(WORDS, file=sys.stderr)
        return 130


def _open_streams() -> None:
    """Let streams that are closed go nowhere: a file would take their place, and what is said."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
            setattr(sys, name, open(number, "w" if number else "r", closefd=False))


def _watch() -> None:
    """Tell a thread of signals: a compiler keeps the main one from them, and may swallow them."""
    told, listening = socket.socketpair()
    told.setblocking(False)
    signal.set_wakeup_fd(told.detach(), warn_on_full_buffer=False)
    threading.Thread(target=_end, args=(listening,), daemon=True).start()


def _end(listening: socket.socket) -> None:
    """Once there was a Ctrl-C, end the process if it does not end by itself."""
    while listening.recv(1)[0] != signal.SIGINT:
        pass
    time.sleep(PATIENCE)
    files = sys.modules.get("jflnr.files")
    for path in list(getattr(files, "unfinished", ())):
        path.unlink(missing_ok=True)
    if threading.main_thread().is_alive():  # else it has said so
        os.write(2, f"{WORDS}\n".encode())
    os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
