"""Frames one after another, the next being read and the last being written meanwhile."""

from collections import deque
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
    waiting = iter(jobs)
    reads: deque[Future] = deque()
    writes: deque[Future] = deque()
    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer:
        try:
            reads.extend(reader.submit(read, job) for job in islice(waiting, 1))
            while reads:
                found = reads.popleft().result()
                reads.extend(reader.submit(read, job) for job in islice(waiting, 1))
                done = work(found)
                while writes:
                    yield writes.popleft().result()
                writes.append(writer.submit(write, done))
            while writes:
                yield writes.popleft().result()
        finally:
            for future in (*reads, *writes):
                future.cancel()
