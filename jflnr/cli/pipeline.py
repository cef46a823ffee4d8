"""Frames one after another, the next being read and the last being written meanwhile."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import Any


def pipelined(
    jobs: Iterable[Any],
    read: Callable[[Any], Any],
    work: Callable[[Any], Any],
    write: Callable[[Any], Any],
) -> Iterator[Any]:
    """What `write(work(read(job)))` returns, job by job.

    `work` runs here, the others on a thread of their own each; at most three jobs are under way.
    """
    waiting, reads, writes = iter(jobs), list[Future](), list[Future]()
    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer:
        coming = lambda: [reader.submit(read, job) for job in islice(waiting, 1)]
        try:
            reads = coming()
            while reads:
                found, reads = reads[0].result(), coming()
                done = work(found)
                yield from (writing.result() for writing in writes)
                writes = [writer.submit(write, done)]
            yield from (writing.result() for writing in writes)
        finally:
            for future in (*reads, *writes):
                future.cancel()
