"""A fleet: the same digits by one worker, by two, and after an interruption; a broken unit is a row."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from independent.fleet import made

import inercal as ic
from inercal.cli import run
from inercal.foundation.computing.cluster import ChunkLostError, Cluster
from inercal.foundation.computing.executors import Processes
from inercal.foundation.errors import InputError
from inercal.laboratory.fleet.batch import _chunks, _rows
from inercal.laboratory.fleet.manifest import FleetUnit, read_manifest
from inercal.laboratory.fleet.unit import Batch, content_of, row_of, row_path
from inercal.laboratory.store import make_store

pytestmark = pytest.mark.usefixtures("undrawn")

TIMES = ("made", "seconds", "timing_s")


@pytest.fixture(scope="module")
def there(tmp_path_factory):
    """The fleet, what is true, and what one worker says of it."""
    folder = tmp_path_factory.mktemp("fleet")
    bias, scale = made(folder)
    return folder, bias, scale, calibrated(folder, folder / "one")


def calibrated(folder, out, **more):
    return ic.batch(folder / "fleet.csv", folder / "imu.toml", out=out, **more)


def told(out):
    """All that was written of the units, but for the times."""
    found = {}
    for path in sorted(out.glob("*/*.json")):
        data = json.loads(path.read_text())
        found[path.relative_to(out).as_posix()] = {k: v for k, v in data.items() if k not in TIMES}
    return found


def seconds(out):
    return {path.name: path.stat().st_mtime_ns for path in out.glob("units/*.json")}


def test_every_unit_is_a_row_and_the_truth_lies_within_its_U(there):
    folder, bias, scale, _ = there
    with open(folder / "one" / "units.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["serial"] for row in rows] == [f"SN {k:03d}" for k in range(30)]
    sound = [row["status"] == "ok" for row in rows]
    assert not sound[12]
    assert sum(sound) >= 26  # each sound unit is doubted with a risk of some 3 %
    assert "unit012.csv" in rows[12]["message"]
    off = [
        abs(float(rows[k][f"{name}_{x} [{unit}]"]) - true[k, i]) / float(rows[k][f"U_{name}_{x} [{unit}]"])
        for name, unit, true in (("K0", "count", bias), ("K1", "count/(m/s^2)", scale))
        for k in range(30)
        if sound[k]
        for i, x in enumerate("xyz")
    ]
    assert max(off) < 2.0
    assert (
        json.loads((folder / "one" / "results" / "SN 003.json").read_text())["traceability"]["serial"]
        == "SN 003"
    )


def test_the_study_of_a_unit_has_its_own_keys(there):
    folder = there[0]
    for k in (3, 5):
        result = json.loads((folder / "one" / "results" / f"SN {k:03d}.json").read_text())
        assert result["conditions"]["temperature"]["value"] == 20.0 + k % 5


def test_the_fleet_names_what_was_put_in(there):
    """A bias and a scale outside, a misalignment unlike the others, a file of no use."""
    fleet = there[3].evidence
    first = {fleet.rows[place].serial: words for place, words in fleet.first}
    doubted = {row.serial for row in fleet.rows if row.status != "ok"}
    assert set(first) == {"SN 004", "SN 009", "SN 012", "SN 017"} | doubted
    assert "K0_y does not conform" in first["SN 004"]
    assert "K1_z does not conform" in first["SN 017"]
    assert "M_x" in first["SN 009"]
    assert "refused" in first["SN 012"]
    assert (fleet.good.good, fleet.good.all) == (30 - len(doubted | {"SN 004", "SN 017"}), 30)
    assert fleet.trends == ()


def few(there, folder, units):
    """The first units of the fleet in a folder of their own."""
    folder.mkdir()
    for path in there[0].glob("*.*"):
        shutil.copy(path, folder)
    lines = (folder / "fleet.csv").read_text().splitlines()
    (folder / "fleet.csv").write_text("\n".join(lines[: units + 1]) + "\n")
    return folder


def test_only_what_changed_is_done_again(there, tmp_path):
    folder, out = few(there, tmp_path / "copy", 8), tmp_path / "out"
    calibrated(folder, out)
    before = seconds(out)
    calibrated(folder, out)
    assert seconds(out) == before
    lines = (folder / "unit005.csv").read_text().splitlines()
    (folder / "unit005.csv").write_text("\n".join(lines[:-1]) + "\n")  # a pose less
    (out / "units" / "SN 007.json").write_text("{")
    calibrated(folder, out)
    assert {name for name, at in seconds(out).items() if at != before[name]} == {
        "SN 005.json",
        "SN 007.json",
    }
    (folder / "imu.toml").write_text((folder / "imu.toml").read_text().replace("(1)", "(2)"))
    calibrated(folder, out)
    assert all(at != before[name] for name, at in seconds(out).items())


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are listed as on Linux")
def test_two_workers_say_the_same_and_killed_in_the_middle_leave_no_process_and_go_on(there, tmp_path):
    folder, out = there[0], tmp_path / "killed"
    words = ["batch", folder / "fleet.csv", "--study", folder / "imu.toml", "--out", out, "--workers", "2"]
    process = subprocess.Popen([sys.executable, "-m", "inercal", *map(str, words), "--quiet"])
    while len(list(out.glob("units/*.json"))) < 5 and process.poll() is None:
        time.sleep(0.01)
    workers = [*map(int, Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split())]
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert len(workers) >= 2
    until = time.monotonic() + 30.0
    while left := [pid for pid in workers if Path(f"/proc/{pid}").exists()]:
        assert time.monotonic() < until, left
        time.sleep(0.05)
    before = seconds(out)
    assert 5 <= len(before) < 30
    calibrated(folder, out, workers=2)
    assert told(out) == told(folder / "one")
    assert all(seconds(out)[name] == at for name, at in before.items())


class Deadly(Batch):
    """A batch whose third unit ends its process."""

    def __call__(self, numbers):
        if 2 in numbers:
            os._exit(9)
        return super().__call__(numbers)


def test_a_unit_that_ends_its_process_is_a_row(there, tmp_path):
    folder, out = few(there, tmp_path / "copy", 4), tmp_path / "deadly"
    for name in ("units", "results"):
        (out / name).mkdir(parents=True)
    units = read_manifest(folder / "fleet.csv")
    work = Deadly(folder / "fleet.csv", content_of(units), folder / "imu.toml", None, out)
    rows = _rows(work, units, Processes(1), 1, lambda done, all: None)
    assert [row.serial for row in rows] == [unit.serial for unit in units]
    assert [row.serial for row in rows if row.status == "failed"] == ["SN 002"]
    assert row_of(out, "SN 002").message.startswith("its process was ended")


class Losing(Cluster):
    """A cluster that gives a chunk up where its third unit is, as one that ended several workers."""

    def map(self, work, chunks):
        for chunk in chunks:
            if 2 in chunk:
                raise ChunkLostError(chunk)
            yield chunk, work(chunk)


@pytest.mark.campaign
def test_of_units_that_went_out_together_one_that_ends_its_process_is_a_row(there, tmp_path, monkeypatch):
    folder, out = few(there, tmp_path / "copy", 4), tmp_path / "lost"
    for name in ("units", "results"):
        (out / name).mkdir(parents=True)
    units = read_manifest(folder / "fleet.csv")
    work = Deadly(folder / "fleet.csv", content_of(units), folder / "imu.toml", None, out)
    monkeypatch.setattr("inercal.laboratory.fleet.batch._chunks", lambda numbers, size: _chunks(numbers, 4))
    rows = _rows(work, units, Losing("local", 1), 1, lambda done, all: None)
    assert [row.serial for row in rows] == [unit.serial for unit in units]
    assert [row.serial for row in rows if row.status == "failed"] == ["SN 002"]


def test_results_are_kept_once(there, tmp_path):
    folder, store = few(there, tmp_path / "copy", 5), make_store(str(tmp_path / "store")).where
    from inercal.laboratory.catalog import results
    from inercal.laboratory.store import open_store

    calibrated(folder, tmp_path / "out", store=store)
    kept = results(open_store(store))
    assert len(kept) == 5
    for path in (tmp_path / "out" / "units").glob("*.json"):
        path.unlink()
    calibrated(folder, tmp_path / "out", store=store)
    assert results(open_store(store)) == kept


def test_files_at_a_url(there, tmp_path):
    import fsspec

    folder, memory = there[0], fsspec.filesystem("memory")
    memory.pipe("/lab/unit000.csv", (folder / "unit000.csv").read_bytes())
    manifest = tmp_path / "fleet.csv"
    manifest.write_text("serial,files\nSN 000,memory://lab/unit000.csv\nSN 001,memory://lab/none.csv\n")
    found = ic.batch(manifest, folder / "imu.toml", out=tmp_path / "out").evidence.rows
    assert [row.status for row in found] == ["ok", "refused"]
    assert found[1].message.startswith("memory://lab/none.csv: cannot be fetched")
    local = there[3].evidence.rows[0].coefficients
    assert found[0].coefficients == local
    inputs = json.loads((tmp_path / "out" / "results" / "SN 000.json").read_text())["inputs"]
    assert inputs[0]["path"] == "memory://lab/unit000.csv"


def test_files_of_a_web_server(there, tmp_path):
    pytest.importorskip("aiohttp")
    quiet = type("Quiet", (SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(quiet, directory=there[0])) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        at = f"http://127.0.0.1:{server.server_port}"
        manifest = tmp_path / "fleet.csv"
        manifest.write_text(f"serial,files\nSN 000,{at}/unit000.csv\nSN 001,{at}/none.csv\n")
        found = ic.batch(manifest, there[0] / "imu.toml", out=tmp_path / "out").evidence.rows
        server.shutdown()
    assert found[0].coefficients == there[3].evidence.rows[0].coefficients
    assert found[1].message.startswith(f"{at}/none.csv: cannot be fetched")


def test_a_folder_is_a_manifest(tmp_path):
    for name in ("b.csv", "a.csv.gz", ".hidden.csv", "notes.md"):
        (tmp_path / name).write_text("")
    (tmp_path / "c").mkdir()
    for name in ("gyro.csv", "acc.csv"):
        (tmp_path / "c" / name).write_text("")
    units = read_manifest(tmp_path)
    assert [unit.serial for unit in units] == ["a", "b", "c"]
    assert [Path(name).name for name in units[2].files] == ["acc.csv", "gyro.csv"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: found no column 'serial'"),
        ("serial,file\n1,a.csv\n", "line 1: found no column 'files'"),
        ("serial,files,files\n1,a.csv,b.csv\n", "line 1: found the column 'files' twice"),
        ("serial,files,two words\n1,a.csv,3\n", "line 1: found the column 'two words'"),
        ("serial,files\n", "holds no unit"),
        ("serial,files\n1\n", "line 2: found 1 cells, expected 2"),
        ("serial,files\n,a.csv\n", "line 2, column serial: found nothing"),
        ("serial,files\n1,a.csv;\n", "line 2, column files: found an empty name"),
        ("serial,files\n1,a.csv\n1,b.csv\n", "found the serial number '1' twice"),
        ('serial,files\n1,"a.csv\n', "unexpected end of data"),
    ],
)
def test_a_manifest_that_is_none_is_refused(tmp_path, text, words):
    path = tmp_path / "fleet.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"fleet\.csv") as caught:
        read_manifest(path)
    assert words in str(caught.value)


def test_a_row_of_a_manifest(tmp_path):
    path = tmp_path / "fleet.csv"
    path.write_text(
        "serial,imu.method,files\n007,means,a.csv; s3://lab/b.csv\n\n008,,c.csv\n", encoding="utf-8-sig"
    )
    assert read_manifest(path) == (
        FleetUnit("007", (str(tmp_path / "a.csv"), "s3://lab/b.csv"), ("imu.method=means",)),
        FleetUnit("008", (str(tmp_path / "c.csv"),)),
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--workers", "0"], "--workers"),
        (["--store", "x"], "--store"),
        (["--study", "none.toml"], "none.toml"),
    ],
)
def test_a_command_that_cannot_be_done_writes_nothing(there, tmp_path, capsys, words, said):
    study = [] if "--study" in words else ["--study", str(there[0] / "imu.toml")]
    assert run(["batch", str(there[0] / "fleet.csv"), *study, "--out", str(tmp_path / "out"), *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_names_of_files_are_safe(tmp_path):
    for serial in ("a/b", "..", "a\\b", "ä b", "x" * 40):
        path = row_path(tmp_path, serial)
        assert path.parent == tmp_path / "units"
    assert len({row_path(tmp_path, s) for s in ("a/b", "a%2Fb", "a b")}) == 3


def test_what_failed_without_fault_of_the_unit_is_tried_again(there, tmp_path, monkeypatch):
    """A store that cannot be reached: the row says so, no result stays, and the next batch does it."""
    folder, out = few(there, tmp_path / "copy", 2), tmp_path / "out"
    store = make_store(str(tmp_path / "store")).where

    def gone(*given, **more):
        raise InputError(store, "cannot be reached")

    with monkeypatch.context() as patch:
        patch.setattr("inercal.laboratory.fleet.unit._keep", gone)
        rows = calibrated(folder, out, store=store).evidence.rows
    assert [row.message for row in rows] == [f"{store}: cannot be reached"] * 2
    assert list((out / "results").iterdir()) == []
    assert [row.status for row in calibrated(folder, out, store=store).evidence.rows] == ["ok", "ok"]


def test_no_result_of_before_stays_beside_a_refusal(there, tmp_path):
    folder, out = few(there, tmp_path / "copy", 2), tmp_path / "out"
    calibrated(folder, out)
    (folder / "unit000.csv").write_text("nothing of use\n")
    calibrated(folder, out)
    assert [path.name for path in (out / "results").iterdir()] == ["SN 001.json"]


def test_the_same_recording_for_two_serial_numbers_is_named(there, tmp_path):
    folder = few(there, tmp_path / "copy", 3)
    manifest = folder / "fleet.csv"
    manifest.write_text(manifest.read_text().replace("unit002.csv", "unit000.csv"))
    found = calibrated(folder, tmp_path / "out")
    assert (found.evidence.good.good, found.status.value) == (1, "suspect")
    assert dict(found.evidence.first) == {
        0: "has the recordings of SN 002",
        2: "has the recordings of SN 000",
    }


def test_limits_without_a_value_are_not_met(there, tmp_path):
    """No unit is good because nothing was there to be judged."""
    folder = few(there, tmp_path / "copy", 2)
    with open(folder / "imu.toml", "a") as study:
        study.write('S_x = "10 ppm"\n')
    found = calibrated(folder, tmp_path / "out")
    assert found.evidence.good.good == 0
    assert dict(found.evidence.first)[1] == "has no S_x, of which there are limits"


def test_no_input_is_written_over(there, tmp_path, capsys):
    folder = few(there, tmp_path / "copy", 2)
    (folder / "fleet.csv").rename(folder / "units.csv")
    before = (folder / "units.csv").read_bytes()
    study = str(folder / "imu.toml")
    assert run(["batch", str(folder / "units.csv"), "--study", study, "--out", str(folder)]) == 2
    assert "is an input, expected another folder" in capsys.readouterr().err
    assert run(["batch", str(folder), "--study", study, "--out", str(folder / "out")]) == 2
    assert "whose files are recordings" in capsys.readouterr().err
    assert (folder / "units.csv").read_bytes() == before
    assert not (folder / "out").exists()


@given(st.sets(st.integers(0, 60)), st.integers(1, 9))
def test_units_go_out_each_once_in_ranges_of_at_most_so_many(numbers, size):
    chunks = _chunks(sorted(numbers), size)
    assert [n for chunk in chunks for n in chunk] == sorted(numbers)
    assert all(1 <= len(chunk) <= size for chunk in chunks)
