"""``inercal live``: the bytes of ``--stream``, refusals, checkpoints, and an end in order or by force."""

import gzip
import json
import signal
import socket
import subprocess
import sys
import time

import h5py
import pytest
from new_studies import FILL
from pyarrow import parquet
from wires import HEADER, STUDY, Datagrams, by_stream, free_port, rows, until

from inercal.cli import run
from inercal.examples import FOLDER
from rows import for_each


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings and studies of each kind, and a calibration."""
    path = tmp_path_factory.mktemp("live")
    for name, count in (("sting", 800), ("selfcal", 300)):
        lines = gzip.decompress((FOLDER / f"{name}.csv.gz").read_bytes()).splitlines(keepends=True)
        (path / f"{name}.csv").write_bytes(b"".join(lines[:count]))
        (path / f"{name}.toml").write_text((FOLDER / f"{name}.toml").read_text("utf-8"), "utf-8")
    assert run(["new", "strapdown", "--out", str(path / "strapdown.toml"), "--quiet", *FILL]) == 0
    text = (path / "strapdown.toml").read_text("utf-8")
    short = text.replace('dwell = "20 s"', 'dwell = "2 s"\nsample_rate = "50 Hz"')
    (path / "strapdown.toml").write_text(short, "utf-8")
    command = ["simulate", "strapdown", str(path / "strapdown.toml"), "--out", str(path / "strapdown.csv")]
    assert run([*command, "--quiet"]) == 0
    (path / "imu.toml").write_text(STUDY)
    (path / "turntable.toml").write_text('[rig]\nkind = "two_axis_turntable"\n[site]\nlatitude = "40 deg"\n')
    (path / "imu.csv").write_bytes(HEADER + b"".join(rows(500)))
    names = [f"K1_{axis}" for axis in "xyz"]
    values = [{"name": name, "value": 1.01, "u": 0.1, "unit": "1"} for name in names]
    calibration = {
        "command": "calibrate imu", "status": {"code": "ok", "message": ""}, "parameters": values,
        "covariance": {"names": names, "matrix": [[0.0] * 3] * 3}, "result": {"unit": {"acc": "m/s^2"}},
    }  # fmt: skip
    (path / "cal.json").write_text(json.dumps(calibration))
    return path


STREAMS = {
    "sting": "aoa --stream sting.csv --study sting.toml",
    "selfcal": "selfcal --stream selfcal.csv --study selfcal.toml",
    "strapdown": "calibrate strapdown --stream strapdown.csv --study strapdown.toml",
    "imu": "monitor imu.csv",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_a_study_decides_which_stream_runs(name, folder, monkeypatch, capsys):
    """The bytes of ``--stream`` on the same lines; its exit code; one line of counts."""
    monkeypatch.chdir(folder)
    code = run([*STREAMS[name].split(), "--quiet"])
    wanted = capsys.readouterr().out
    assert wanted.count("\n") > 1
    assert run(["live", f"replay:{name}.csv?speed=0", "--study", f"{name}.toml"]) == code
    out, err = capsys.readouterr()
    assert out == wanted
    count = (folder / f"{name}.csv").read_bytes().count(b"\n") - 1
    assert f"\n{count} rows; text:-: " in f"\n{err}"


def test_a_calibration_corrects(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert run(["apply", "cal.json", "--stream", "imu.csv", "--quiet"]) == 0
    wanted = capsys.readouterr().out
    assert run(["live", "replay:imu.csv?speed=0", "--apply", "cal.json", "--quiet"]) == 0
    assert capsys.readouterr() == (wanted, "")


def test_an_interval_an_override_and_a_packed_recording(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    (folder / "imu.csv.gz").write_bytes(gzip.compress((folder / "imu.csv").read_bytes()))
    assert run(["monitor", "imu.csv", "--every", "0.1 s", "--quiet"]) == 0
    wanted = capsys.readouterr().out
    words = ["live", "replay:imu.csv.gz?speed=0", "--study", "imu.toml", "--quiet", "--set"]
    assert run([*words, "site.gravity=9.8 m/s^2", "--every", "0.1 s"]) == 0
    assert capsys.readouterr() == (wanted, "")


def test_a_replay_keeps_the_time_of_its_stamps(folder, monkeypatch, capsys):
    """Half a second of rows at twice their speed; as fast as it goes it took less (above)."""
    monkeypatch.chdir(folder)
    began = time.monotonic()
    assert run(["live", "replay:imu.csv?speed=2", "--study", "imu.toml", "--quiet"]) == 0
    assert time.monotonic() - began >= 0.499 / 2
    assert capsys.readouterr().out.count("\n") == 501


@for_each(
    "words, said",
    [
        ("live replay:imu.csv", "--study, --apply: found neither, expected one of them"),
        ("live replay:imu.csv --study imu.toml --apply cal.json", "--study, --apply: found both"),
        ("live replay:imu.csv --apply cal.json --set a=b", "--set: found with --apply"),
        ("live imu.csv --study imu.toml", "found no known kind of address"),
        (
            "live replay:imu.csv --study turntable.toml",
            "is of the kind turntable, expected imu, strapdown, selfcal or aoa",
        ),
        ("live replay:imu.csv --study none.toml", "none.toml: "),
        ("live replay:none.csv --study imu.toml", "none.csv: cannot be read (No such file or directory)"),
        ("live replay:imu.csv --study imu.toml --record imu.csv", "imu.csv: found it for two things"),
        ("live replay:imu.csv --study imu.toml --to text:a --to text:a", "a: found it for two things"),
        ("live replay:imu.csv --study imu.toml --to udp://h:1 --to udp://h:1", "--to: found a sink twice"),
        ("live replay:imu.csv --study imu.toml --to text:imu.toml", "imu.toml: is there already"),
        ("live replay:imu.csv --study imu.toml --record no/a.csv", "no/a.csv: cannot be written"),
        ("live replay:imu.csv --study imu.toml --to parquet:no/p", "no/p: cannot be written"),
        ("live replay:imu.csv --study imu.toml --json", "--json: found with a stream"),
        ("live replay:imu.csv --study imu.toml --checkpoint imu.csv", "imu.csv: is an input"),
        ("live replay:sting.csv?speed=0 --study selfcal.toml", "sting.csv: "),
        ("live replay:cal.json?speed=0 --study imu.toml", "cal.json: "),
    ],
)
def test_refusals_are_one_sentence(folder, monkeypatch, capsys, words, said):
    monkeypatch.chdir(folder)
    before = {path.name for path in folder.iterdir()}
    assert run(words.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = [line for line in err.splitlines() if "compiling" not in line and " rows" not in line]
    assert len(lines) == 1, err
    assert lines[0].startswith("inercal: error: ")
    assert said in lines[0]
    assert {path.name for path in folder.iterdir()} - before <= {"a"}
    (folder / "a").unlink(missing_ok=True)


def test_it_goes_on_from_a_checkpoint(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sent = [HEADER, *rows(300)]
    (tmp_path / "begun.csv").write_bytes(b"".join(sent[:201]))
    (tmp_path / "whole.csv").write_bytes(b"".join(sent))
    common = ["--study", str(folder / "imu.toml"), "--checkpoint", "state", "--quiet"]
    assert run(["live", "replay:begun.csv?speed=0", "--to", "text:one.csv", *common]) == 0
    assert run(["live", "replay:whole.csv?speed=0", "--to", "text:two.csv", *common]) == 0
    one, two = ((tmp_path / f"{name}.csv").read_text().splitlines(keepends=True) for name in ("one", "two"))
    assert one + two[1:] == by_stream(sent)


def started(folder, port, *more):
    """The command at a port, once it listens."""
    words = [
        sys.executable,
        "-m",
        "inercal",
        "live",
        f"udp://127.0.0.1:{port}",
        "--study",
        folder / "imu.toml",
    ]
    made = subprocess.Popen([*words, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def listens():
        assert made.poll() is None, made.communicate()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            try:
                other.bind(("127.0.0.1", port))
            except OSError:
                return True
        return False

    assert until(listens, 120.0)
    return made


@pytest.mark.slow
def test_asked_to_end_it_ends_in_order(folder, tmp_path, request):
    """SIGTERM: what has come is answered, held rows and the last piece are written, counts are said, code 130."""
    near = Datagrams(free_port(socket.SOCK_DGRAM))
    request.addfinalizer(near.close)
    made = started(folder, near.port, "--to", f"parquet:{tmp_path / 'p'}", "--to", "text:-")
    sent = [HEADER, *rows(200)]
    for line in sent:
        near.send(line)
    time.sleep(1.0)
    made.send_signal(signal.SIGTERM)
    out, err = made.communicate(timeout=60)
    assert made.returncode == 130, err
    assert out.splitlines(keepends=True) == by_stream(sent)
    assert parquet.read_table(tmp_path / "p").num_rows == 200
    assert "200 rows; parquet:" in err
    assert err.endswith("interrupted\n")


@pytest.mark.slow
def test_killed_what_was_written_survives(folder, tmp_path, request):
    """kill -9 at any moment: every piece is whole, the recording ends with a row, and from a checkpoint the same
    command loses no line: those of both runs are all lines, with the same digits where they come twice."""
    near = Datagrams(free_port(socket.SOCK_DGRAM))
    request.addfinalizer(near.close)
    sent = [HEADER, *rows(1200)]
    found = {}
    wanted = by_stream(sent)
    for run_of in range(3):
        made = started(
            folder, near.port, "--quiet", "--checkpoint", tmp_path / "state", "--checkpoint-every", "100",
            "--to", f"parquet:{tmp_path / 'p'}", "--to", f"hdf5:{tmp_path / 'h'}",
            "--record", tmp_path / f"raw{run_of}.csv",
        )  # fmt: skip
        for k in range(0, len(sent), 20):
            for line in sent[k : k + 20]:
                near.send(line)
            time.sleep(0.005)
            if run_of < 2 and len(list((tmp_path / "p").glob("*.parquet"))) > 3 * (run_of + 1):
                break
        if run_of < 2:
            made.kill()
        else:
            assert until(lambda: (tmp_path / "raw2.csv").read_bytes().count(b"\n") == len(sent), 60.0)
            made.send_signal(signal.SIGINT)
        out, err = made.communicate(timeout=60)
        assert (made.returncode, out) == ((-signal.SIGKILL, "") if run_of < 2 else (130, "")), err
        raw = (tmp_path / f"raw{run_of}.csv").read_bytes()
        assert b"".join(sent).startswith(raw)
        assert raw.endswith(b"\n")
    titles = wanted[0].strip().split(",")
    pieces = sorted((tmp_path / "p").glob("*.parquet"))
    for path in pieces:
        for row in parquet.read_table(path).select(titles).to_pylist():
            line = ",".join("" if value != value else repr(value) for value in row.values())
            assert found.setdefault(row["t [s]"], line) == line
    as_floats = [[repr(float(x)) if x else "" for x in line.strip("\n").split(",")] for line in wanted[1:]]
    assert [found[t] for t in sorted(found)] == [",".join(line) for line in as_floats]
    stamps = []
    for path in sorted((tmp_path / "h").glob("*.h5")):
        with h5py.File(path) as file:
            stamps += file["t"][()].tolist()
    assert sorted(set(stamps)) == sorted(found)
