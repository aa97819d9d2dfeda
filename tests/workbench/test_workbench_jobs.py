"""Jobs run one after the other in processes of their own, can be cancelled, and are found again after kill -9."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from inercal.bench.workbench import jobs
from inercal.bench.workbench.jobs import JobState, Queue
from inercal.examples import FOLDER
from inercal.foundation.errors import InputError

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
    assert (job.state, job.code) == (JobState.DONE, 0)
    assert json.loads((job.folder / "printed").read_text())["status"]["code"] == "ok"
    assert job.command == "inercal examples --json --quiet"


def test_a_refusal_is_one_sentence(queue, tmp_path):
    job = queue.wait(queue.add("0001", tmp_path, ["inspect", "absent.csv"]).id, 60.0)
    assert (job.state, job.code) == (JobState.REFUSED, 2)
    assert job.said.startswith("inercal: error: absent.csv: ")
    assert job.said.count("\n") == 1


def test_a_folder_that_has_gone_refuses_the_job_and_the_next_one_runs(queue, tmp_path):
    gone = queue.add("0001", tmp_path / "gone", LISTS)
    after = queue.add("0001", tmp_path, LISTS)
    assert queue.wait(after.id, 60.0).state is JobState.DONE
    assert queue.get(gone.id).state is JobState.REFUSED


def test_jobs_come_one_after_the_other_and_cancelling_ends_both_kinds(queue, tmp_path):
    running, waiting = queue.add("0001", tmp_path, LONG), queue.add("0001", tmp_path, LISTS)
    until = time.monotonic() + 30.0
    while queue.get(running.id).state is JobState.WAITING and time.monotonic() < until:
        time.sleep(0.02)
    assert [queue.get(job.id).state for job in (running, waiting)] == [JobState.RUNNING, JobState.WAITING]
    queue.cancel(waiting.id)
    began = time.monotonic()
    queue.cancel(running.id)
    assert queue.wait(running.id, 30.0).state is JobState.CANCELLED
    assert time.monotonic() - began < 15.0
    assert [queue.get(job.id).state for job in (running, waiting)] == [JobState.CANCELLED, JobState.CANCELLED]
    assert queue.wait(queue.again(waiting.id).id, 60.0).state is JobState.DONE


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
from inercal.bench.workbench.jobs import Queue
queue = Queue(Path(sys.argv[1]))
done = queue.add("0001", Path(sys.argv[1]), ["examples", "--quiet"])
queue.wait(done.id, 60.0)
queue.add("0001", Path(sys.argv[1]), ["monitor", "--quiet"])
queue.add("0001", Path(sys.argv[1]), ["allan", "log.csv", "--quiet"])
while queue.get("00002").state.value != "running":
    time.sleep(0.02)
print(queue._process.pid, flush=True)
time.sleep(600)
"""


def test_after_kill_9_jobs_are_done_or_plainly_interrupted_and_the_rest_goes_on(tmp_path):
    (tmp_path / "jobs").mkdir()
    rows = "".join(f"{i / 10},{(i * i) % 7 / 100}\n" for i in range(500))
    (tmp_path / "jobs" / "log.csv").write_text(f"t [s],acc_x [m/s^2]\n{rows}")
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
        assert queue.get("00001").state is JobState.DONE
        assert queue.get("00002").state is JobState.INTERRUPTED
        assert queue.wait("00003", 60.0).state is JobState.DONE
    finally:
        queue.close()


def test_a_module_of_python_among_the_files_of_a_session_is_not_run(queue, tmp_path):
    (tmp_path / "json.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    assert queue.wait(queue.add("0001", tmp_path, LISTS).id, 60.0).state is JobState.DONE
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("words", "named"),
    [(["inspect", "\0"], "the command"), (["keep", "x", "--instrument", "\ud800"], "--instrument")],
)
def test_an_argument_that_is_no_text_is_no_job(queue, tmp_path, words, named):
    with pytest.raises(InputError, match=f"{named}: found .* expected plain text"):
        queue.add("0001", tmp_path, words)
    assert [*queue] == []
    assert queue.wait(queue.add("0001", tmp_path, LISTS).id, 60.0).id == "00001"


def test_an_argument_that_is_too_long_refuses_the_job_and_the_next_one_runs(queue, tmp_path):
    long = queue.add("0001", tmp_path, ["inspect", "x" * 3_000_000])
    after = queue.add("0001", tmp_path, LISTS)
    assert queue.wait(after.id, 60.0).state is JobState.DONE
    assert (queue.get(long.id).state, queue.get(long.id).code) == (JobState.REFUSED, 2)
    assert queue.get(long.id).said.count("\n") == 1


@pytest.mark.parametrize(
    "error",
    [ValueError("embedded null byte"), UnicodeEncodeError("utf-8", "\ud800", 0, 1, "odd"), RuntimeError("x")],
)
def test_whatever_befalls_a_job_the_next_one_runs(queue, tmp_path, monkeypatch, error):
    begun = jobs._begun

    def failing(job, *more):
        if job.id == "00001":
            raise error
        return begun(job, *more)

    monkeypatch.setattr(jobs, "_begun", failing)
    first, second = queue.add("0001", tmp_path, LISTS), queue.add("0001", tmp_path, LISTS)
    assert queue.wait(second.id, 60.0).state is JobState.DONE
    assert queue.get(first.id).state is JobState.REFUSED
    assert queue.get(first.id).said.startswith("inercal: error: ")


def test_a_disk_that_is_full_refuses_what_comes_and_ends_nothing(queue, tmp_path, monkeypatch):
    def full(path, text):
        raise InputError(path, "cannot be written (No space left on device)")

    with monkeypatch.context() as patch:
        patch.setattr(jobs, "write_text", full)
        with pytest.raises(InputError, match="No space left"):
            queue.add("0001", tmp_path, LISTS)
    assert queue.wait(queue.add("0001", tmp_path, LISTS).id, 60.0).state is JobState.DONE


SOUND = {
    "session": "0001",
    "arguments": ["validate"],
    "where": ".",
    "state": "done",
    "made": "2026",
    "code": 0,
}


@pytest.mark.parametrize(
    "spoiled",
    [
        {"arguments": ["keep", "\0", "--instrument", "\ud800"], "state": "waiting", "code": None},
        {"arguments": ["keep", "\0", "--instrument", "\ud800"], "state": "running", "code": None},
        {"session": "\ud800"}, {"made": "\0"}, {"where": "\0", "state": "waiting"}, {"arguments": []},
        {"arguments": [1]}, {"arguments": "validate"}, {"arguments": None}, {"arguments": {"a": 1}},
        {"made": 7}, {"session": None}, {"code": "x"}, {"state": []}, {"where": ["x"]},
    ],
)  # fmt: skip
def test_a_job_that_an_earlier_workbench_left_spoiled_is_told_or_left_out(spoiled, tmp_path):
    from inercal.bench.workbench.bench import Bench
    from inercal.bench.workbench.rest import _of_job
    from inercal.bench.workbench.sessions import Sessions

    for folder, about in (("00001", {**SOUND, **spoiled}), ("00002", SOUND), ("other", SOUND)):
        (tmp_path / "jobs" / folder).mkdir(parents=True)
        (tmp_path / "jobs" / folder / "job.json").write_text(json.dumps(about))
    (tmp_path / "jobs" / "00003").mkdir()
    (tmp_path / "jobs" / "00003" / "job.json").write_text("[" * 100_000)
    queue = Queue(tmp_path / "jobs")
    try:
        told = [json.dumps(_of_job(job), ensure_ascii=False).encode() for job in queue]
        assert 1 <= len(told) <= 2
        assert not [job for job in queue if job.state in (JobState.WAITING, JobState.RUNNING)]
        assert queue.wait(queue.add("0001", tmp_path, LISTS).id, 60.0).id == "00004"
        assert Bench(tmp_path, Sessions(tmp_path), queue).last_design is not None
    finally:
        queue.close()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["store", "export", "{0}/copy"], "found 'store export'"),
        (["batch", "x", "--study", "y", "--cluster", "tcp://evil:1"], "found 'batch'"),
        (["keep", "result.json", "--store", "postgresql://evil/x"], "found 'keep'"),
        (["validate", "--out", "{0}/mine.json"], "lies outside the folder of the job"),
        (["validate", "--report=../../mine.html"], "lies outside the folder of the job"),
        (["validate", "--keep", "--store", "{0}/other"], "--keep: found in a job of an earlier workbench"),
        (["allan", "/etc/passwd"], "/etc/passwd: lies outside the work folder"),
        (["selfcal", "--study", "s.toml", "--stream"], "found --stream"),
    ],
)
def test_a_job_that_somebody_put_into_the_folder_is_refused(arguments, expected, tmp_path):
    folder = tmp_path / "work" / "jobs" / "00001"
    folder.mkdir(parents=True)
    words = [each.format(tmp_path) for each in arguments]
    about = {**SOUND, "arguments": words, "where": str(tmp_path / "work"), "state": "waiting", "code": None}
    (folder / "job.json").write_text(json.dumps(about))
    queue = Queue(tmp_path / "work" / "jobs")
    try:
        job = queue.get("00001")
        assert (job.state, job.code) == (JobState.REFUSED, 2)
        assert expected in job.said
        assert job.said.count("\n") == 1
        with pytest.raises(InputError, match="expected"):
            queue.again("00001")
    finally:
        queue.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["work"]


@pytest.mark.parametrize("way", ["study", "map", "settings of another program"])
def test_a_stored_job_reads_only_files_of_its_work_folder(way, tmp_path):
    """Neither what a map names elsewhere, nor settings that a library would read from the folder."""
    where, folder = tmp_path / "work" / "sessions" / "0001", tmp_path / "work" / "jobs" / "00001"
    where.mkdir(parents=True)
    folder.mkdir(parents=True)
    for name in ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml"):
        (where / name).write_bytes((FOLDER / name).read_bytes())
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    if way == "map":
        column_map = (where / "ferraris-map.toml").read_text()
        outside = tmp_path / "outside.csv.gz"
        outside.write_bytes((FOLDER / "ferraris.csv.gz").read_bytes())
        more = f'[file.a]\npath = "{outside}"\n{column_map.replace("[columns]", "[file.a.columns]")}'
        (where / "ferraris-map.toml").write_text(f"{column_map}\n{more}")
    elif way == "study":
        (where / "ferraris.toml").unlink()
        (where / "ferraris.toml").symlink_to(tmp_path / "ferraris.toml")
    else:
        (where / ".numba_config.yaml").write_text("chrome_trace: victim.txt\n")
    words = ["calibrate", "imu", "ferraris.csv.gz", "--map", "ferraris-map.toml", "--study", "ferraris.toml"]
    about = {**SOUND, "arguments": words, "where": str(where), "state": "waiting", "code": None}
    (folder / "job.json").write_text(json.dumps(about))
    queue = Queue(tmp_path / "work" / "jobs")
    try:
        job = queue.get("00001")
        assert job.state is JobState.REFUSED, job.said
        assert "expected" in job.said
    finally:
        queue.close()


def test_a_pipe_in_the_folder_of_a_job_is_not_waited_for(tmp_path):
    folder = tmp_path / "jobs" / "00001"
    folder.mkdir(parents=True)
    (folder / "job.json").write_text(json.dumps(SOUND))
    os.mkfifo(folder / "said")
    queue = Queue(tmp_path / "jobs")
    try:
        assert queue.get("00001").said == ""
    finally:
        queue.close()


def test_a_job_of_a_work_folder_elsewhere_is_refused(tmp_path):
    folder = tmp_path / "work" / "jobs" / "00001"
    folder.mkdir(parents=True)
    (folder / "job.json").write_text(
        json.dumps({**SOUND, "arguments": ["allan", "x.csv"], "where": "/", "state": "waiting"})
    )
    queue = Queue(tmp_path / "work" / "jobs")
    try:
        assert "outside the work folder" in queue.get("00001").said
    finally:
        queue.close()
