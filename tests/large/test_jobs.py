"""Many frames: beside each other in one process, and on workers that die."""

import os
import signal
import threading
import time

import pytest

from jflnr.cli import main
from jflnr.cli.jobs import pipelined


def test_results_come_in_order_and_each_job_passes_once():
    passed = []
    double, keep = lambda x: 2 * x, lambda x: passed.append(x) or x
    assert list(pipelined(range(7), double, lambda x: x + 1, keep)) == [1, 3, 5, 7, 9, 11, 13]
    assert passed == [1, 3, 5, 7, 9, 11, 13]
    assert list(pipelined([], double, double, keep)) == []


def test_the_next_is_read_and_the_last_written_meanwhile():
    """Each stage waits for another job to be in another stage: alone it would wait for ever."""
    reading_next, writing_last = threading.Event(), threading.Event()

    def read(job):
        if job == 2:
            reading_next.set()
        return job

    def work(job):
        if job == 1:
            assert reading_next.wait(20) and writing_last.wait(20)
        return job

    def write(job):
        if job == 0:
            writing_last.set()
        return job

    assert list(pipelined([0, 1, 2], read, work, write)) == [0, 1, 2]


@pytest.mark.parametrize("stage", [0, 1, 2])
def test_a_defect_in_a_stage_is_not_swallowed(stage):
    stages = [lambda job: job] * 3
    stages[stage] = lambda job: 1 // (job - 2)
    with pytest.raises(ZeroDivisionError):
        list(pipelined(range(5), *stages))


def write_slowly(job):
    """As `jflnr denoise` does: what exists is done; a file appears whole."""
    number, folder = job
    path = folder / f"{number}.txt"
    if path.exists():
        return number, "kept"
    if number == 3:
        raise ValueError("3 is no good")
    time.sleep(0.3)
    path.write_text(str(os.getpid()))
    return number, "written"


def test_a_killed_worker_loses_nothing_and_a_failure_is_told(tmp_path):
    pytest.importorskip("distributed")
    from jflnr.cluster import each, local_cluster

    jobs = [(number, tmp_path) for number in range(8)]
    found = []
    with local_cluster(2) as local:
        for result in each(
            local.scheduler_address, write_slowly, jobs, lambda job, error: (job[0], str(error))
        ):
            found.append(result)
            if len(found) == 3:
                os.kill(local.workers[0].pid, signal.SIGKILL)
    assert sorted(number for number, _ in found) == list(range(8))
    assert (3, "3 is no good") in found
    assert sorted(p.stem for p in tmp_path.iterdir()) == [str(n) for n in range(8) if n != 3]


def test_no_scheduler_is_named(frame_file, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("jflnr.cluster.PATIENCE", 0)
    command = ["denoise", str(frame_file), "-o", str(tmp_path / "out"), "--cluster"]
    assert main([*command, "tcp://127.0.0.1:9"]) == 2
    assert "no scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
