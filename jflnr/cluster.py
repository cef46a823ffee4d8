"""Work on many machines, by Dask: one job at a time per worker, none lost, none done twice."""

import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import nullcontext
from typing import Any

# How often a job is given to another worker after the one that had it died.
RETRIES = 3
# For how many seconds a scheduler may be away, and how often it is looked for.
PATIENCE, PAUSE = 600, 2


def each(
    address: str,
    work: Callable[[Any], Any],
    jobs: Sequence[Any],
    failed: Callable[[Any, BaseException], Any],
) -> Iterator[Any]:
    """`work(job)` of every job on a cluster, in the order in which they are finished.

    address: `tcp://HOST:PORT` of a scheduler; "" for a cluster of this machine's cores. work: must
    see for itself what is done already: a job whose worker or scheduler went away is given out
    again. failed: makes a result of a job and what went wrong with it.

    Raises ImportError without Dask, OSError if no scheduler answers.
    """
    left = dict(enumerate(jobs))
    workers: Any = nullcontext() if address else local_cluster(cores())
    with workers as local:
        scheduler = address or local.scheduler_address
        deadline = time.monotonic() + (PATIENCE if address else 0)
        known = False
        while left:
            try:
                with _distributed().Client(scheduler, timeout=10) as client:
                    known, deadline = True, time.monotonic() + PATIENCE
                    for number, result, error in _finished(client, work, left):
                        job = left.pop(number)
                        yield result if error is None else failed(job, error)
            except (OSError, CancelledError) as error:
                if not known or time.monotonic() > deadline:
                    raise OSError(f"--cluster: no scheduler answers at {scheduler}") from error
                print(f"The scheduler at {scheduler} is gone; waiting for it.", file=sys.stderr)
                time.sleep(PAUSE)


def _finished(
    client: Any, work: Callable[[Any], Any], left: dict[int, Any]
) -> Iterator[tuple[int, Any, BaseException | None]]:
    """Number, result and error of the jobs as they are finished."""
    futures = {
        client.submit(work, job, pure=False, retries=RETRIES): number
        for number, job in left.items()
    }
    for future in _distributed().as_completed(list(futures)):
        if future.status == "cancelled":
            raise ConnectionError("the scheduler forgot the job")
        error = future.exception() if future.status == "error" else None
        yield futures[future], None if error else future.result(), error
        future.release()


def cores() -> int:
    """The cores that this process may use: the workers of a cluster on this machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def local_cluster(count: int) -> Any:
    """Dask workers on this machine, processes of one thread each; a context manager."""
    workers = {"n_workers": count, "threads_per_worker": 1, "memory_limit": 0}
    quiet = {"dashboard_address": ":0", "silence_logs": logging.ERROR}
    return _distributed().LocalCluster(**workers, **quiet)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise ImportError("--cluster needs Dask: pip install 'jflnr[cluster]'") from None
    return distributed
