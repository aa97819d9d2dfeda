"""A session with secrets leaves none behind: not in files, the database, the process list or what is printed."""

import base64
import contextlib
import http.server
import json
import os
import threading
import time
from functools import partial
from pathlib import Path

import psycopg
import pytest
from certified import LAB
from independent.fleet import made

from inercal.bench.workbench.bench import open_bench
from inercal.cli import run
from inercal.examples import FOLDER

SECRET = "Hunter2SeCrEt"
FERRARIS = ["ferraris.csv.gz", "--map", "ferraris-map.toml", "--study", "ferraris.toml"]
TABLES = [word for key in ("maker=M", "model=G", "serial=S5") for word in ("--set", f"item.{key}")]
CALIBRATE = ["calibrate", "imu", *FERRARIS, *TABLES]


def spellings():
    """The secret as text, and as it stands within base64 at any offset."""
    plain = SECRET.encode()
    inner = [base64.b64encode(b"." * k + plain)[4 * (k > 0) + 1 : -5] for k in range(3)]
    return [plain, *inner]


def files_with_secret(folder):
    """Files below a folder in which the secret stands; those of Parquet are unpacked."""
    found = []
    for path in (path for path in Path(folder).rglob("*") if path.is_file()):
        content = path.read_bytes()
        if path.suffix == ".parquet":
            import pyarrow.parquet

            content = str(pyarrow.parquet.read_table(path).to_pylist()).encode()
        if any(each in content for each in spellings()) or SECRET in path.name:
            found.append(path.relative_to(folder))
    return found


@contextlib.contextmanager
def process_list():
    """Command lines of all processes that live while the block runs and hold the secret."""
    found, over = set(), threading.Event()

    def look():
        while not over.is_set():
            for path in Path("/proc").glob("[0-9]*/cmdline"):
                with contextlib.suppress(OSError):
                    line = path.read_bytes()
                    if SECRET.encode() in line:
                        found.add(line)
            time.sleep(0.01)

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield found
    finally:
        over.set()
        thread.join()


@pytest.fixture
def database(server, tmp_path):
    """URL of an empty database, with a password that its server does not ask for."""
    name = f"s{abs(hash(tmp_path)):x}"
    with psycopg.connect(f"{server}/postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    return f"{server.replace('@', f':{SECRET}@')}/{name}"


def rows_of(url):
    """All rows of a database as texts."""
    with psycopg.connect(url) as connection:
        names = connection.execute("SELECT tablename FROM pg_tables WHERE schemaname = 'public'").fetchall()
        return [str(row) for (name,) in names for row in connection.execute(f"SELECT t::text FROM {name} t")]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a recording, in which the commands run."""
    work = tmp_path / "work"
    work.mkdir()
    for name in ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml"):
        (work / name).write_bytes((FOLDER / name).read_bytes())
    (work / "lab.toml").write_text(LAB)
    monkeypatch.chdir(work)
    return work


@pytest.mark.slow
def test_a_laboratory_with_a_password_in_its_store(folder, database, capsys, monkeypatch):
    """By option and by environment, from the first result to certificate, rerun and export; sound and refused."""
    lines = [
        ["store", "init", "--store", database, "--objects", str(folder.parent / "objects")],
        [*CALIBRATE, "--keep", f"--store={database}", "--out", "r.json", "--report", "r.html"],
        [*CALIBRATE, "--keep", "--store", database, "--out", "r.toml", "--json"],
        ["keep", "r.json", "--store", database, "--json"],
        ["certificate", "r.json", "--lab", "lab.toml", "--number", "1", "--out", "c.xml", "--store", database],
        ["instruments", "--store", database],
        ["results", "--store", database, "--json"],
        ["store", "check", "--store", database, "--json"],
        ["store", "upgrade", "--store", database],
        ["store", "scrub", "--store", database],
        ["store", "export", "copy", "--store", database],
    ]  # fmt: skip
    refused = [
        ["results", "--store", database.replace("/s", "/absent", 1)],
        ["results", "--store", f"{database}?password={SECRET}2&unknown={SECRET}"],
        ["results", "--store", database.replace("postgresql://", "postgresql:")],
        ["results", "--store", database.replace("127.0.0.1", "[")],
        ["results", "--store", f"mysql://u:{SECRET}@h/db"],
        ["results", "--stor", database],
        ["results", database],
        ["calibrate", "imu", *FERRARIS, "--store", database],
        ["calibrate", "imu", f"s3://KEY:{SECRET}@bucket/x.csv", "--study", "ferraris.toml"],
        ["store", "init", "--store", "other", "--objects", f"s3://KEY:{SECRET}@bucket/objects"],
        ["batch", "lab.toml", "--study", "ferraris.toml", "--out", "b", "--cluster", f"tcp://u:{SECRET}@127.0.0.1:1"],
        ["live", f"mqtt://u:{SECRET}@h/t", "--study", "ferraris.toml"],
        ["live", f"tcp://127.0.0.1:1?user=u&password={SECRET}", "--study", "ferraris.toml"],
    ]  # fmt: skip
    with process_list() as seen:
        for line in lines:
            assert run(line) == 0, line
        monkeypatch.setenv("INERCAL_STORE", database)
        before = capsys.readouterr()
        assert run(["results", "--json"]) == 0
        listed = capsys.readouterr()
        (kept,) = json.loads(listed.out)["result"]["results"]
        assert run(["rerun", kept["id"]]) == 0
        assert run(["history", "S5", "--out", "h.json"]) in (0, 1, 2)
        monkeypatch.delenv("INERCAL_STORE")
        for line in refused:
            assert run(line) == 2, line
    assert SECRET not in "".join((*before, *listed, *capsys.readouterr()))
    assert files_with_secret(folder.parent) == []
    assert not [row for row in rows_of(database) if SECRET in row]
    assert not seen


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A handler that says nothing on standard error."""

    def log_message(self, *said):
        pass


@contextlib.contextmanager
def web(folder):
    """Address of a server of the files of a folder."""
    handler = partial(
        type("Quiet", (http.server.SimpleHTTPRequestHandler,), {"log_message": lambda *_: None}),
        directory=folder,
    )
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


@pytest.mark.slow
def test_a_fleet_with_passwords_in_its_manifest_and_store(tmp_path, database, capsys, monkeypatch):
    """Recordings by HTTP with a login and a signed address, one of them absent; results kept by two processes."""
    source = tmp_path / "source"
    source.mkdir()
    made(source, 3)
    monkeypatch.chdir(tmp_path)
    with web(source) as host, process_list() as seen:
        signed = f"http://user:{SECRET}@{host}/unit000.csv?X-Signature={SECRET}"
        rows = [
            f"SN 1,{signed}",
            f"SN 2,http://{SECRET}@{host}/unit001.csv",
            f"SN 3,http://u:{SECRET}@{host}/absent.csv",
        ]
        manifest = tmp_path / "fleet.csv"
        manifest.write_text("\n".join(["serial,files", *rows]) + "\n")
        (source / "units.csv").write_bytes(manifest.read_bytes())
        assert run(["store", "init", "--store", database, "--objects", "objects", "--quiet"]) == 0
        line = [
            "batch",
            "fleet.csv",
            "--study",
            "source/imu.toml",
            "--out",
            "out",
            "--keep",
            "--store",
            database,
        ]
        assert run([*line, "--workers", "2"]) == 1
        assert run([*line, "--workers", "2", "--json"]) == 1  # goes on from there
        assert run([*line, "--cluster", "tcp://127.0.0.1:1"]) == 2
    said = capsys.readouterr()
    assert "--store: found a secret in it, which a cluster would be sent" in said.err
    assert SECRET not in said.out + said.err
    manifest.unlink()
    (source / "units.csv").unlink()
    assert files_with_secret(tmp_path) == []
    kept = [row for row in rows_of(database) if "unit00" in row]
    assert len(kept) == 2
    assert not [row for row in rows_of(database) if SECRET in row]
    assert not seen


@pytest.mark.slow
def test_a_workbench_with_a_password_in_its_store(tmp_path, database, capsys):
    """Its jobs get the store by their environment; a folder of 0.2.0, whose jobs state it, is cleaned when it opens."""
    assert run(["store", "init", "--store", database, "--objects", str(tmp_path / "objects"), "--quiet"]) == 0
    old = tmp_path / "bench" / "jobs" / "00001"
    old.mkdir(parents=True)
    about = {
        "session": "0001",
        "arguments": ["keep", "r.json", "--store", database],
        "where": str(tmp_path),
        "state": "done",
    }
    (old / "job.json").write_text(json.dumps({**about, "made": "2026-01-01T00:00:00+00:00", "code": 0}))
    bench = open_bench(tmp_path / "bench", database)
    try:
        with process_list() as seen:
            job = bench.queue.wait(bench.run(bench.sessions.begin_with("ferraris")).id, 120.0)
            assert job.state.value == "done", job.said
            kept = bench.queue.wait(bench.keep(job, "M, G, S5").id, 120.0)
            assert kept.state.value == "done", kept.said
            assert len(bench.instruments()) == 1
            again = bench.queue.wait(bench.queue.again(kept.id).id, 120.0)
            assert again.state.value == "done", again.said
        assert [each.command for each in bench.queue][-1] == "inercal keep r.json"
        assert SECRET not in repr(bench)
    finally:
        bench.close()
    assert not seen
    assert files_with_secret(tmp_path) == []
    assert not [row for row in rows_of(database) if SECRET in row]
    assert SECRET not in "".join(capsys.readouterr())
    assert "INERCAL_STORE" not in os.environ or SECRET not in os.environ["INERCAL_STORE"]
