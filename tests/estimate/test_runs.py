import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import monte_carlo_tasks as tasks
import numpy as np
import pytest

from inercal.foundation.computing.executors import Processes, Serial, Threads
from inercal.foundation.computing.runs import RunError, generator, run
from inercal.foundation.errors import InercalError, InputError


@dataclass(frozen=True)
class Backwards:
    """An executor of somebody else's: last chunk first."""

    def map(self, work, chunks):
        for chunk in reversed(chunks):
            yield chunk, work(chunk)


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k]) for k in a)


def chunk_files(folder):
    return sorted(Path(folder).glob("chunk-*.npz"))


def arrays_in(path):
    with np.load(path) as arrays:
        return dict(arrays)


@pytest.fixture(scope="module")
def reference():
    return run(tasks.line_fit, runs=101, seed=5)


# The digits do not depend on where and in which order the runs are done.


@pytest.mark.parametrize(
    "executor", [Threads(1), Threads(2), Threads(3), Backwards(), Processes(2)], ids=repr
)
@pytest.mark.parametrize("chunk", [None, 7])
def test_any_executor_gives_the_same_digits(reference, executor, chunk):
    assert same(run(tasks.line_fit, runs=101, seed=5, executor=executor, chunk=chunk), reference)


@pytest.mark.parametrize("chunk", [1, 100, 101, 1000])
def test_any_chunk_size_gives_the_same_digits(reference, chunk):
    assert same(run(tasks.line_fit, runs=101, seed=5, chunk=chunk), reference)


def test_a_longer_campaign_begins_with_the_same_runs(reference):
    longer = run(tasks.line_fit, runs=150, seed=5)
    assert same({k: a[:101] for k, a in longer.items()}, reference)


def test_a_run_can_be_repeated_by_hand(reference):
    again = tasks.line_fit(generator(5, 42))
    assert all(np.array_equal(reference[k][42], again[k]) for k in reference)


def test_streams_are_those_of_spawned_seed_sequences():
    child = np.random.SeedSequence(5).spawn(4)[3]
    expected = np.random.Generator(np.random.PCG64(child)).random(6)
    np.testing.assert_array_equal(generator(5, 3).random(6), expected)


def test_runs_and_seeds_differ(reference):
    assert len(np.unique(reference["errors"])) == reference["errors"].size
    assert not np.isin(run(tasks.line_fit, runs=101, seed=6)["errors"], reference["errors"]).any()


def test_shapes(reference):
    assert {k: a.shape for k, a in reference.items()} == {"errors": (101, 2), "u": (101, 2), "dof": (101,)}
    assert all(a.dtype == np.float64 for a in reference.values())


def test_global_random_state_is_left_alone():
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    run(tasks.line_fit, runs=3, seed=5)
    np.testing.assert_array_equal(before, np.random.get_state()[1])  # noqa: NPY002


def test_progress_is_told_in_the_calling_thread():
    told = []
    run(
        tasks.line_fit,
        runs=10,
        seed=5,
        chunk=4,
        executor=Threads(2),
        progress=lambda done, total: told.append((done, total, threading.current_thread())),
    )
    assert [t[2] for t in told] == [threading.main_thread()] * 4
    assert told[0][:2] == (0, 10)
    assert told[-1][:2] == (10, 10)
    assert [t[0] for t in told] == sorted(t[0] for t in told)


@pytest.mark.parametrize("bad", [{"runs": 0}, {"chunk": 0}, {"seed": -1}])
def test_bad_counts(bad):
    with pytest.raises(InputError, match="expected 1, 1, 0 or more"):
        run(tasks.line_fit, **{"runs": 1, "seed": 0, **bad})


# Failures.


@pytest.mark.parametrize("executor", [Serial(), Threads(2), Processes(2)], ids=repr)
def test_an_exception_names_the_run_that_repeats_it(executor):
    threads = threading.active_count()
    with pytest.raises(RunError, match=r"run \d+ of seed 3 failed: InputError: x: got 0\.0") as failure:
        run(tasks.unlucky, runs=400, seed=3, executor=executor)
    assert failure.value.__cause__ is not None
    with pytest.raises(InputError):
        tasks.unlucky(generator(failure.value.seed, failure.value.run))
    assert threading.active_count() == threads


@pytest.mark.parametrize("chunk", [1, 10])
def test_runs_that_return_other_shapes_are_named(chunk):
    def task(rng):
        return {"x": np.zeros(3 if rng.random() < 0.8 else 4)}

    odd = next(i for i in range(10) if generator(3, i).random() >= 0.8)
    assert odd > 0
    said = rf"run {odd} of seed 3 failed: returned {{'x': \(4,\)}}, expected {{'x': \(3,\)}} as in run 0"
    with pytest.raises(RunError, match=said):
        run(task, runs=10, seed=3, chunk=chunk)


def test_threads_stop_between_runs():
    done = []

    def work(numbers):
        for number in numbers:
            time.sleep(0.01)
            done.append(number)
        return {}

    finished = Threads(2).map(work, [range(1), range(1, 1000)])
    assert next(finished) == (range(1), {})
    finished.close()
    assert len(done) < 10
    assert not [t for t in threading.enumerate() if "ThreadPool" in t.name]


def test_an_interrupt_closes_the_executor():
    closed = []

    class Watched:
        def map(self, work, chunks):
            try:
                yield from Serial().map(work, chunks)
            finally:
                closed.append(True)

    def interrupt(done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tasks.line_fit, runs=10, seed=0, executor=Watched(), progress=interrupt)
    assert closed


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_worker_that_dies_does_not_hang_the_campaign():
    with pytest.raises(InercalError, match="a process at work was ended"):
        run(tasks.killed, runs=3, seed=0, executor=Processes(1))


def test_a_task_that_no_other_process_can_find():
    with pytest.raises(Exception, match=r"Can't pickle|Can't get local object"):
        run(lambda rng: {"x": 1.0}, runs=3, seed=0, executor=Processes(1))


# A campaign in another process, which tells on its output how far it is. The output stays open as long as
# anybody who inherited it is alive: reading to its end shows that no worker was left behind.


@contextmanager
def campaign(task, folder, runs, workers):
    env = os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    program = "import monte_carlo_tasks, sys; monte_carlo_tasks.main(*sys.argv[1:])"
    command = [sys.executable, "-c", program, task, str(folder), str(runs), str(workers)]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, env=env, text=True, stdout=pipe, stderr=pipe, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(process, done):
    for line in process.stdout:
        if int(line) >= done:
            return
    pytest.fail(process.stderr.read())


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("workers", [0, 2])
def test_killed_and_resumed_gives_the_same_digits(tmp_path, workers):
    with campaign("slow", tmp_path, 40, workers) as process:
        wait_for(process, 5)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=50)
    assert process.returncode == -signal.SIGKILL
    kept = len(chunk_files(tmp_path))
    assert 5 <= kept < 40
    told = []
    again = run(
        tasks.slow, runs=40, seed=11, chunk=1, folder=tmp_path, progress=lambda done, total: told.append(done)
    )
    assert told[0] == kept
    assert same(again, run(tasks.slow, runs=40, seed=11, executor=Threads(8)))
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_an_interrupt_ends_processes_at_once(tmp_path):
    with campaign("sometimes_endless", tmp_path, 4, 2) as process:
        wait_for(process, 1)
        os.killpg(process.pid, signal.SIGINT)  # as Ctrl-C does: to the workers, too
        _, errors = process.communicate(timeout=50)
    assert process.returncode == -signal.SIGINT
    assert errors.rstrip().endswith("KeyboardInterrupt")


# Resuming.


def test_finished_chunks_are_not_done_again(tmp_path, reference, monkeypatch):
    run(tasks.line_fit, runs=101, seed=5, chunk=20, folder=tmp_path)
    assert len(chunk_files(tmp_path)) == 6
    monkeypatch.setattr(np.linalg, "lstsq", None)
    assert same(run(tasks.line_fit, runs=101, seed=5, chunk=20, folder=tmp_path), reference)


def truncate(data):
    return data[: len(data) // 2]


def flip_a_bit(data):
    return data[:400] + bytes([data[400] ^ 1]) + data[401:]


@pytest.mark.parametrize("damage", [truncate, flip_a_bit, lambda data: b"", lambda data: b"chunk"])
def test_damaged_chunks_are_done_again(tmp_path, reference, damage):
    run(tasks.line_fit, runs=101, seed=5, chunk=20, folder=tmp_path)
    whole = chunk_files(tmp_path)[2]
    before = arrays_in(whole)
    whole.write_bytes(damage(whole.read_bytes()))
    told = []
    again = run(
        tasks.line_fit,
        runs=101,
        seed=5,
        chunk=20,
        folder=tmp_path,
        executor=Threads(2),
        progress=lambda done, total: told.append(done),
    )
    assert same(again, reference)
    assert told == [81, 101]
    assert same(arrays_in(whole), before)


def test_a_chunk_of_another_length_is_done_again(tmp_path, reference):
    run(tasks.line_fit, runs=101, seed=5, chunk=20, folder=tmp_path)
    first, *_, last = chunk_files(tmp_path)
    first.write_bytes(last.read_bytes())
    assert same(run(tasks.line_fit, runs=101, seed=5, chunk=20, folder=tmp_path), reference)


def test_a_failed_campaign_keeps_what_it_had(tmp_path):
    told = []
    for _ in range(2):
        with pytest.raises(RunError):
            run(
                tasks.unlucky,
                runs=400,
                seed=3,
                chunk=1,
                folder=tmp_path,
                progress=lambda d, t: told.append(d),
            )
    assert len(chunk_files(tmp_path)) == max(told) > 0
    assert told.count(max(told)) == 2


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"seed": 6}, r"with {'seed': 5}, expected {'seed': 6}"),
        ({"runs": 60}, r"with {'runs': 50}, expected {'runs': 60}"),
        ({"chunk": 5}, r"with {'chunk': 10}, expected {'chunk': 5}"),
        ({"task": tasks.slow}, r"'task': 'monte_carlo_tasks.line_fit'.*expected.*'monte_carlo_tasks.slow'"),
    ],
)
def test_another_campaign_in_the_folder(tmp_path, changed, said):
    def go(task=tasks.line_fit, seed=5, runs=50, chunk=10):
        return run(task, runs=runs, seed=seed, chunk=chunk, folder=tmp_path / "new" / "folder")

    go()
    with pytest.raises(InputError, match=rf"manifest.json: belongs to another campaign, .*{said}"):
        go(**changed)


@pytest.mark.parametrize("make", [tasks.Noise, lambda s: partial(tasks.Noise.__call__, tasks.Noise(s))])
def test_another_parameter_is_another_campaign(tmp_path, make):
    first = run(make(2.0), runs=5, seed=5, folder=tmp_path)
    assert same(run(make(2.0), runs=5, seed=5, folder=tmp_path), first)
    with pytest.raises(InputError, match=r"belongs to another campaign, with {'content'"):
        run(make(3.0), runs=5, seed=5, folder=tmp_path)


def test_another_numpy_is_another_campaign(tmp_path):
    run(tasks.line_fit, runs=5, seed=5, folder=tmp_path)
    path = tmp_path / "manifest.json"
    manifest = json.loads(path.read_text())
    assert manifest.keys() == {"task", "content", "seed", "runs", "chunk", "numpy", "inercal"}
    path.write_text(json.dumps(manifest | {"numpy": "1.0"}))
    with pytest.raises(InputError, match=r"with {'numpy': '1.0'}"):
        run(tasks.line_fit, runs=5, seed=5, folder=tmp_path)


@pytest.mark.parametrize("content", ["", "{", "3"])
def test_a_manifest_that_cannot_be_read(tmp_path, content):
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(InputError, match="cannot be read"):
        run(tasks.line_fit, runs=5, seed=5, folder=tmp_path)


def test_chunks_without_a_manifest(tmp_path):
    run(tasks.line_fit, runs=5, seed=5, folder=tmp_path)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(InputError, match="is missing beside finished chunks"):
        run(tasks.line_fit, runs=5, seed=5, folder=tmp_path)


def test_a_task_without_a_name_has_no_folder(tmp_path):
    with pytest.raises(InputError, match="cannot be kept in a folder, expected a function of a module"):
        run(lambda rng: {"x": 1.0}, runs=5, seed=5, folder=tmp_path)
    assert not list(tmp_path.iterdir())
