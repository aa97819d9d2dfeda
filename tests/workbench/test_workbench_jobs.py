"""Jobs run one after the other in processes of their own, can be cancelled, and are found again after kill -9."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from inercal.errors import InputError
from inercal.workbench.jobs import Queue, State

LISTS = ["examples", "--json", "--quiet"]
"""A command that takes a moment."""

LONG = ["monitor", "--quiet"]
"""A command that waits for lines on standard input, which stays open."""


@pytest.fixture
def queue(tmp_path):
    made = Queue(tmp_path / "jobs")
    yield made
    made.close()


def test_a_job_leaves_what_its_command_says_and_its_exit_code(queue, tmp_path):
    job = queue.wait(queue.add("0001", tmp_path, LISTS).id, 60.0)
    assert (job.state, job.code) == (State.DONE, 0)
    assert json.loads((job.folder / "printed").read_text())["status"]["code"] == "ok"
    assert job.command == "inercal examples --json --quiet"


def test_a_refusal_is_one_sentence(queue, tmp_path):
    job = queue.wait(queue.add("0001", tmp_path, ["inspect", "absent.csv"]).id, 60.0)
    assert (job.state, job.code) == (State.REFUSED, 2)
    assert job.said.startswith("inercal: error: absent.csv: ")
    assert job.said.count("\n") == 1


def test_a_folder_that_has_gone_refuses_the_job_and_the_next_one_runs(queue, tmp_path):
    gone = queue.add("0001", tmp_path / "gone", LISTS)
    after = queue.add("0001", tmp_path, LISTS)
    assert queue.wait(after.id, 60.0).state is State.DONE
    assert queue.get(gone.id).state is State.REFUSED


def test_jobs_come_one_after_the_other_and_cancelling_ends_both_kinds(queue, tmp_path):
    running, waiting = queue.add("0001", tmp_path, LONG), queue.add("0001", tmp_path, LISTS)
    until = time.monotonic() + 30.0
    while queue.get(running.id).state is State.WAITING and time.monotonic() < until:
        time.sleep(0.02)
    assert [queue.get(job.id).state for job in (running, waiting)] == [State.RUNNING, State.WAITING]
    queue.cancel(waiting.id)
    began = time.monotonic()
    queue.cancel(running.id)
    assert queue.wait(running.id, 30.0).state is State.CANCELLED
    assert time.monotonic() - began < 15.0
    assert [queue.get(job.id).state for job in (running, waiting)] == [State.CANCELLED, State.CANCELLED]
    assert queue.wait(queue.again(waiting.id).id, 60.0).state is State.DONE


def test_an_unknown_job_is_refused(queue):
    with pytest.raises(InputError, match="job 7: found none"):
        queue.get("7")


def test_the_same_command_again_writes_to_its_own_folder(queue, tmp_path):
    job = queue.wait(queue.add("0001", tmp_path, ["examples", "--out", "{out}/x"]).id, 60.0)
    again = queue.wait(queue.again(job.id).id, 60.0)
    assert job.arguments[-1] == os.path.relpath(job.folder / "x", tmp_path)
    assert again.arguments[-1] == os.path.relpath(again.folder / "x", tmp_path)


_BEGINS = """
import sys, time
from pathlib import Path
from inercal.workbench.jobs import Queue
queue = Queue(Path(sys.argv[1]))
done = queue.add("0001", Path(sys.argv[1]), ["examples", "--quiet"])
queue.wait(done.id, 60.0)
queue.add("0001", Path(sys.argv[1]), ["monitor", "--quiet"])
queue.add("0001", Path(sys.argv[1]), ["examples", "--quiet"])
while queue.get("00002").state.value != "running":
    time.sleep(0.02)
print(queue._process.pid, flush=True)
time.sleep(600)
"""


def test_after_kill_9_jobs_are_done_or_plainly_interrupted_and_the_rest_goes_on(tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", _BEGINS, str(tmp_path / "jobs")], stdout=subprocess.PIPE
    ) as killed:
        child = int(killed.stdout.readline())
        killed.send_signal(signal.SIGKILL)
    until = time.monotonic() + 30.0
    while os.path.exists(f"/proc/{child}") and time.monotonic() < until:  # it ends with its parent
        time.sleep(0.05)
    assert not os.path.exists(f"/proc/{child}")
    queue = Queue(tmp_path / "jobs")
    try:
        assert queue.get("00001").state is State.DONE
        assert queue.get("00002").state is State.INTERRUPTED
        assert queue.wait("00003", 60.0).state is State.DONE
    finally:
        queue.close()
