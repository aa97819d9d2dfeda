"""A real scheduler and workers as processes: what is lost on the way changes no digit."""

import json
import os
import signal
import subprocess
import sys
import time
from argparse import Namespace
from contextlib import contextmanager

import numpy as np
import pytest
from independent.fleet import made
from test_fleet import seconds, told

import inercal as ic
from inercal.foundation.computing.cluster import ChunkLostError, Cluster
from inercal.foundation.computing.runs import run
from inercal.foundation.errors import InercalError, InputError

pytest.importorskip("distributed")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")

RUNS, SEED = 24, 5


def noise(rng):
    """A run of some milliseconds."""
    time.sleep(0.03)
    return {"x": rng.standard_normal(3)}


def deadly(rng):
    """A run that ends its process."""
    os._exit(3)


@pytest.fixture(scope="module")
def expected():
    return run(noise, runs=RUNS, seed=SEED)["x"]


@contextmanager
def cluster(folder, workers=2, ttl="30s", failures="3"):
    """A scheduler and workers of their own; yields its file, the scheduler, the workers, and a way to one more."""
    file = folder / "scheduler.json"
    env = {
        **os.environ,
        "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": ttl,
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": failures,
        "PYTHONPATH": os.pathsep.join(sys.path),
        "OPENBLAS_NUM_THREADS": "1",
    }

    def started(kind, *words):
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen(command, env=env, **quiet)

    def worker():
        words = ["--scheduler-file", str(file), "--nthreads", "1", "--no-nanny", "--death-timeout", "60"]
        return started("worker", *words)

    processes = [started("scheduler", "--scheduler-file", str(file), "--host", "127.0.0.1", "--port", "0")]
    try:
        while not file.exists():
            time.sleep(0.05)
        processes += [worker() for _ in range(workers)]
        if workers:
            _wait_for(file, workers)
        yield str(file), processes, worker
    finally:
        for each in processes:
            each.send_signal(signal.SIGCONT)
            each.kill()
        for each in processes:
            each.wait()


@contextmanager
def worker_beside(file):
    """One more worker at a scheduler."""
    words = ["--scheduler-file", file, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    command = [sys.executable, "-m", "distributed.cli.dask_worker", *words]
    process = subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _wait_for(file, 3)
        yield
    finally:
        process.kill()
        process.wait()


def _wait_for(file, workers):
    from distributed import Client

    with Client(scheduler_file=str(file)) as client:
        client.wait_for_workers(workers, timeout=60)


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    """A cluster of two workers to which nothing happens."""
    with cluster(tmp_path_factory.mktemp("cluster")) as found:
        yield found[0]


@pytest.mark.slow
def test_a_campaign_has_the_digits_of_one_process(quiet, expected):
    with open(quiet) as file:
        address = json.load(file)["address"]
    assert address.startswith("tcp://")
    found = run(noise, runs=RUNS, seed=SEED, executor=Cluster(address), chunk=1)["x"]
    assert np.array_equal(found, expected)


@pytest.mark.slow
def test_a_fleet_has_the_digits_of_one_process(quiet, tmp_path):
    made(tmp_path, 8)
    outs = [tmp_path / "one", tmp_path / "many"]
    for out, more in zip(outs, ({}, {"cluster": quiet}), strict=True):
        ic.batch(tmp_path / "fleet.csv", tmp_path / "imu.toml", out=out, **more)
    one, many = ({path.name: coefficients(path) for path in out.glob("units/*.json")} for out in outs)
    assert one == many
    assert len(one) == 8


class Unprepared:
    """Work that its workers cannot make ready."""

    def __call__(self, numbers):
        return list(numbers)

    def prepare(self):
        raise OSError("no room\nfor kernels")


@pytest.mark.slow
def test_work_that_no_worker_can_begin_is_refused_and_leaves_nothing(quiet, expected):
    with pytest.raises(InputError, match=r"a worker cannot begin \(.*no room for kernels") as caught:
        list(Cluster(quiet).map(Unprepared(), [range(1)]))
    assert "\n" not in str(caught.value)
    with worker_beside(quiet):  # what could not begin is not asked of one that comes later
        assert np.array_equal(
            run(noise, runs=4, seed=SEED, executor=Cluster(quiet), chunk=1)["x"], expected[:4]
        )


@pytest.mark.slow
def test_a_campaign_of_the_benchmarks_has_the_answers_of_one_process(quiet, tmp_path):
    """Absurd runs, whose time is limited in a worker's thread too, kept and taken up again."""
    from absurd.runs import Absurd
    from campaigns.places import answers

    def ended(cluster, workers=None):
        given = Namespace(workers=workers, cluster=cluster, checkpoint=tmp_path / f"{cluster is None}")
        return [each[:2] for each in answers(Absurd("drift"), 24, given, {"room": "drift"}, 4)]

    assert ended(quiet) == ended(None, 1)
    assert len({outcome for outcome, _ in ended(quiet)}) > 2  # from its checkpoint


def coefficients(path):
    return json.loads(path.read_text())["coefficients"]


@pytest.mark.slow
def test_a_worker_that_is_killed_and_one_that_hangs_lose_nothing(tmp_path, expected):
    """One of three is killed in the middle, one stopped: same digits, every run once."""
    with cluster(tmp_path, 3, ttl="8s") as (file, processes, _):
        seen = []

        def progress(done, runs):
            seen.append(done)
            if len(seen) == 4:
                processes[1].kill()
            if len(seen) == 6:
                processes[2].send_signal(signal.SIGSTOP)

        found = run(noise, runs=RUNS, seed=SEED, executor=Cluster(file), chunk=1, progress=progress)["x"]
    assert np.array_equal(found, expected)
    assert seen == list(range(RUNS + 1))


@pytest.mark.slow
def test_work_that_ends_every_worker_is_named(tmp_path):
    with cluster(tmp_path, failures="1") as (file, _, _), pytest.raises(ChunkLostError) as caught:
        run(deadly, runs=1, seed=SEED, executor=Cluster(file), chunk=1)
    assert caught.value.chunk == range(0, 1)


@pytest.mark.slow
def test_a_scheduler_that_is_killed_ends_the_command_which_goes_on_later(tmp_path, expected):
    kept = tmp_path / "kept"
    with cluster(tmp_path, 1) as (file, processes, _):
        seen = []

        def progress(done, runs):
            seen.append(done)
            if len(seen) == 8:
                processes[0].kill()

        with pytest.raises(InercalError, match="scheduler was lost"):
            run(noise, runs=RUNS, seed=SEED, executor=Cluster(file), chunk=1, folder=kept, progress=progress)
    done = len(list(kept.glob("chunk-*.npz")))
    assert 7 <= done < RUNS
    assert np.array_equal(run(noise, runs=RUNS, seed=SEED, chunk=1, folder=kept)["x"], expected)


@pytest.mark.slow
def test_no_worker_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr("inercal.foundation.computing.cluster._PATIENCE", 2.0)
    with cluster(tmp_path, 0) as (file, _, _), pytest.raises(InputError, match="found no worker"):
        run(noise, runs=1, seed=SEED, executor=Cluster(file))


def test_no_scheduler_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match="expected 'local', an address"):
        run(noise, runs=1, seed=SEED, executor=Cluster(str(tmp_path / "none.json")))


@pytest.mark.slow
def test_workers_of_another_program_are_refused(quiet, monkeypatch):
    monkeypatch.setattr("inercal.foundation.computing.cluster.program", lambda: "0" * 64)
    with pytest.raises(InputError, match="another program"):
        run(noise, runs=1, seed=SEED, executor=Cluster(quiet))


@pytest.mark.slow
def test_a_client_that_is_killed_goes_on_and_leaves_no_work(quiet, tmp_path):
    """What it had asked for is forgotten by the scheduler; the same command ends with the same digits."""
    from distributed import Client

    made(tmp_path, 10)
    out = tmp_path / "out"
    words = [
        "batch",
        tmp_path / "fleet.csv",
        "--study",
        tmp_path / "imu.toml",
        "--out",
        out,
        "--cluster",
        quiet,
    ]
    command = [sys.executable, "-m", "inercal", *map(str, words), "--quiet"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while len(list(out.glob("units/*.json"))) < 3 and process.poll() is None:
        time.sleep(0.01)
    process.kill()
    process.wait()
    with Client(scheduler_file=quiet) as client:
        until = time.monotonic() + 30.0
        while (left := client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))) > 0:
            assert time.monotonic() < until, f"{left} tasks are left"
            time.sleep(0.1)
    assert subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0
    ic.batch(tmp_path / "fleet.csv", tmp_path / "imu.toml", out=tmp_path / "one")
    one, many = (
        {path.name: coefficients(path) for path in at.glob("units/*.json")} for at in (tmp_path / "one", out)
    )
    assert one == many


@pytest.mark.campaign
def test_five_hundred_units_over_every_kill_are_those_of_one_process(tmp_path):
    """On two workers, then on a cluster with kill -9 of a worker, of the client, of the scheduler: each unit once."""
    made(tmp_path, 500)
    files = (tmp_path / "fleet.csv", tmp_path / "imu.toml")
    ic.batch(*files, out=tmp_path / "one")
    ic.batch(*files, out=tmp_path / "two", workers=2)
    out = tmp_path / "cluster"

    def begun(file):
        words = ["batch", files[0], "--study", files[1], "--out", out, "--cluster", file, "--quiet"]
        command = [sys.executable, "-m", "inercal", *map(str, words)]
        with open(tmp_path / "said", "a") as said:
            return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)

    def at(units, process):
        while len(list(out.glob("units/*.json"))) < units:
            assert process.poll() is None, (tmp_path / "said").read_text()
            time.sleep(0.01)

    first, again = tmp_path / "first", tmp_path / "again"
    first.mkdir()
    again.mkdir()
    with cluster(first) as (file, processes, worker):
        client = begun(file)
        at(100, client)
        processes[1].kill()
        processes.append(worker())
        at(200, client)
        client.kill()
        client.wait()
        kept = seconds(out)
        client = begun(file)
        at(350, client)
        processes[0].kill()
        assert client.wait() == 2
        assert "the scheduler was lost" in (tmp_path / "said").read_text()
    assert {name: seconds(out)[name] for name in kept} == kept
    kept = seconds(out)
    assert len(kept) < 500
    with cluster(again) as (file, _, _):
        client = begun(file)
        assert client.wait() == 1  # not all units are good
    assert {name: seconds(out)[name] for name in kept} == kept
    assert told(tmp_path / "one") == told(tmp_path / "two") == told(out)
    assert len(list(out.glob("units/*.json"))) == 500
